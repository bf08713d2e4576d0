"""heyoka, an integrator by Taylor series that LLVM compiles, on the equation of a vehicle.

It gets the table of terms of rov_fmu/equation/terms.py, so it has the same states as ours, with the cosine and sine of
the heading. It is compiled once. The forces of a held command and the direction of each drag are runtime parameters, so
commands must not turn any velocity back. It computes no thrust and looks for no reversal, which favours it.
"""

import copy
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.expression import ONE, Expression, compiled
from rov_fmu.equation.terms import Term, equation_of
from rov_fmu.vehicle.vehicle import Vehicle

from .page import Section, digits, duration

NOT_INSTALLED = ['heyoka (pip install "rov-fmu[benchmarks]")', "not installed"]
"""The row of the table that takes its place. It fits into a line, because readers look for it."""
Reals = NDArray[np.float64]


def installed() -> bool:
    """Return True when heyoka can be imported."""
    return find_spec("heyoka") is not None


def _value(formula: Expression, at: Mapping[str, float]) -> float:
    return float(compiled({"value": formula})(at)["value"])


class Heyoka:
    """The integrator of a vehicle. Its tolerance is the rounding error, heyoka's default."""

    def __init__(self, rov: Vehicle) -> None:
        import heyoka

        self._rov, self._equation = rov, equation_of(rov.layout)
        rows = self._equation.rows
        coefficients = dict.fromkeys(term.coefficient for terms in rows.values() for term in terms)
        self._parameters = [formula for formula in coefficients if formula not in (ONE, -ONE)]
        parameter = {formula: heyoka.par[n] for n, formula in enumerate(self._parameters)}
        symbols = dict(zip(rows, heyoka.make_vars(*rows), strict=True))

        def product(term: Term) -> object:
            coefficient = parameter.get(term.coefficient)
            first = heyoka.expression(_value(term.coefficient, {})) if coefficient is None else coefficient
            return heyoka.prod([first, *(symbols[name] for name in term.factors)])

        self._system = [(symbols[name], heyoka.sum([product(term) for term in terms])) for name, terms in rows.items()]
        start, parameters = np.zeros(len(rows)), np.zeros(len(self._parameters))
        self._integrator = heyoka.taylor_adaptive(self._system, start, pars=parameters)

    def hold(self, h: float, steps: int, commands: Reals, start: Reals) -> tuple[float, Reals]:
        """Hold commands one after the other, each for `steps` steps of h. Return seconds per step, and the final state.

        The steps run in a loop in C++: propagate_for takes none that is longer than h. Each command begins with a call
        from Python, which is timed too.
        """
        integrator, end, seconds = self._integrator, start.copy(), 0
        for command in commands:
            at = self._at(command, end)
            initial, values = self._beginning(at)
            integrator.time = 0.0
            integrator.state[:], integrator.pars[:] = initial, values
            began = time.thread_time_ns()
            _, _, _, taken, *_ = integrator.propagate_for(h * steps, max_delta_t=h)
            seconds += time.thread_time_ns() - began
            assert taken >= steps
            end = self._end(at, integrator.state)
        return 1e-9 * seconds / (len(commands) * steps), end

    @cache  # noqa: B019 - heyoka compiles for seconds, and few of these objects are made
    def integrator(self, size: int, thread: int) -> Any:
        """Return the integrator of `size` vehicles at once for a thread; that of one vehicle is the scalar one."""
        import heyoka

        if thread:
            return copy.deepcopy(self.integrator(size, 0))
        if size == 1:
            return self._integrator
        start, parameters = np.zeros((len(self._system), size)), np.zeros((len(self._parameters), size))
        return heyoka.taylor_adaptive_batch(self._system, start, pars=parameters)

    def begun(self, command: Reals, state: Reals) -> tuple[list[float], list[float]]:
        """Return the states of the equation and the parameters with which a held command begins at a state."""
        return self._beginning(self._at(command, state))

    def _beginning(self, at: dict[str, float]) -> tuple[list[float], list[float]]:
        values = [_value(formula, at) for formula in self._parameters]
        return [at.get(name, 0.0) for name in self._equation.states], values

    def _end(self, at: dict[str, float], state: Reals) -> Reals:
        """Return the states of the vehicle. Forces that lag and the quaternion are not states of the equation."""
        at = at | dict(zip(self._equation.states, state.tolist(), strict=True))
        found = at | {force: _value(after, at) for force, (_, after) in self._equation.lagging.items()}
        for name, formula in self._equation.ends.items():
            at[name] = found[name.removeprefix("next_")] = _value(formula, at)
        return np.array([found[name] for name in self._rov.layout.state])

    def _at(self, command: Reals, state: Reals) -> dict[str, float]:
        """Return the values of all formulas at the start of a held command."""
        layout, equation = self._rov.layout, self._equation
        at = dict.fromkeys(layout.inputs, 0.0) | dict(zip(layout.commands, command.tolist(), strict=True))
        at |= {**self._rov.coefficients, **dict(zip(layout.state, state.tolist(), strict=True))}
        for name, formula in {**equation.program, **equation.forces}.items():
            at[name] = _value(formula, at)
        for name, directed in equation.directed.items():  # a velocity at rest goes where its force pushes it
            subject, ahead, astern = directed.args
            (v,) = subject.names
            is_reverse = at[v] < 0.0 or (at[v] == 0.0 and at[f"constant_{v}"] < 0.0)
            at[name] = _value(astern if is_reverse else ahead, at)
        return at


class Fleet:
    """Vehicles in heyoka, each at its own state with commands of its own."""

    def __init__(self, rov: Vehicle, commands: Reals, starts: Reals, copies: int = 1) -> None:
        self._series = Heyoka(rov)
        begun = [self._series.begun(*both) for both in zip(commands, starts, strict=True)] * copies
        self._states, self._parameters = (np.array(part) for part in zip(*begun, strict=True))

    def step(self, size: int, h: float, steps: int, cores: int = 1) -> tuple[float, float, bool]:
        """Step `size` vehicles at once, all of them on each core; 1 is the scalar integrator.

        Return the seconds and the steps that heyoka took, each per vehicle and step of h, and whether the states
        remained finite.
        """
        integrators = [self._series.integrator(size, n) for n in range(cores)]
        with ThreadPoolExecutor(cores) as pool:
            each = [pool.submit(self._step, own, size, h, steps) for own in integrators]
        costs, taken, finite = zip(*(one.result() for one in each), strict=True)
        return sum(costs) / cores**2, taken[0], all(finite)

    def _step(self, integrator: Any, size: int, h: float, steps: int) -> tuple[float, float, bool]:
        seconds, taken, finite = 0, 0, True
        for first in range(0, len(self._states), size):
            states, parameters = (each[first : first + size].T for each in (self._states, self._parameters))
            began = time.thread_time_ns()
            if size == 1:
                integrator.time = 0.0
                integrator.state[:], integrator.pars[:] = states[:, 0], parameters[:, 0]
                taken += integrator.propagate_for(h * steps, max_delta_t=h)[3]
            else:
                integrator.set_time(0.0)
                integrator.state[:], integrator.pars[:] = states, parameters
                integrator.propagate_for([h * steps] * size, max_delta_t=[h] * size)
                taken += sum(result[3] for result in integrator.propagate_res)
            seconds += time.thread_time_ns() - began
            finite &= bool(np.isfinite(integrator.state).all())
        per_step = len(self._states) * steps
        return 1e-9 * seconds / per_step, taken / per_step, finite


VEHICLES, MANY = 256, 2560
"""The numbers of vehicles that are stepped together: multiples of the sizes of heyoka's batches. With many, it hardly
counts that our time has the call from Python, and that of heyoka has not."""
STEPS = {0.001: 300, 0.01: 30, 1.0: 10}
"""The steps of each length, s. With lag, heyoka leaves the finite numbers after 0.3 to 1 s."""
OURS, LANES, TURNING = "simulate_many", "simulate_many(lanes=True)", "lanes=True, commands that reverse"
BATCHES = {"heyoka": 1, "heyoka, batches of 4": 4, "heyoka, batches of 8": 8}


@dataclass(frozen=True)
class Many:
    """What many vehicles cost with steps of one length on some cores."""

    cores: int
    vehicles: int
    h: float
    seconds: Mapping[str, Reals]
    """For each way to step them, the seconds per vehicle and step in each repetition."""
    taken: Mapping[str, float]
    """The steps that heyoka took for one of h, or NaN where its states did not remain finite."""

    def ratio(self, way: str, others: Iterable[str]) -> float:
        """Return the median of the ratio of the seconds to those of another way, of that with the smallest median."""
        best = min((self.seconds[other] for other in others), key=lambda seconds: float(np.median(seconds)))
        return float(np.median(self.seconds[way] / best))


def many_vehicles(rov: Vehicle, h: float, repetitions: int, cores: int = 1, vehicles: int = VEHICLES) -> Many:
    """Step vehicles that hold commands of their own, in turn by each way, as many on each core.

    There are VEHICLES different ones; more are copies of these.

    The time is the processor time of all cores over their number, so waiting for other programs does not count.
    They have moved for 0.2 s with their commands before, so no velocity turns back in what is measured. simulate_many
    computes the thrust, looks for reversals, and records all states after each step, which heyoka does not. In a run of
    their own, which heyoka cannot make, all commands change at random to and fro, each second or at each longer step.
    """
    commands = np.random.default_rng(48).uniform(0.2, 0.6, (VEHICLES, len(rov.layout.commands)))
    steps, layout = STEPS[h], rov.layout
    inputs: dict[str, Reals] = {name: commands[:, [n]] for n, name in enumerate(layout.commands)}
    starts = simulate(rov, [0.0, 0.2], inputs, vehicles=VEHICLES).values[:, :, -1].T
    copies = vehicles // VEHICLES
    heyoka = Fleet(rov, commands, starts, copies) if installed() else None
    values = inputs | {name: starts[:, [n]] for n, name in enumerate(layout.state)}
    times = h * np.arange(steps + 1)
    held = max(1, round(1.0 / h))
    changes = np.random.default_rng(49).uniform(-0.6, 0.6, (len(commands.T), VEHICLES, steps // held + 1))
    turning = values | dict(zip(inputs, np.repeat(changes, held, axis=2)[..., : steps + 1], strict=True))
    seconds, taken = defaultdict(list), {}
    ours = {OURS: values, LANES: values, TURNING: turning}
    on_all = {
        way: {name: np.tile(array, (cores * copies, 1)) for name, array in given.items()} for way, given in ours.items()
    }
    for _ in range(repetitions + 1):  # the first one is not counted: it compiles
        for way, given in on_all.items():
            began = time.process_time_ns()
            simulate(rov, times, given, vehicles=vehicles * cores, workers=cores, lanes=way != OURS)
            seconds[way].append(1e-9 * (time.process_time_ns() - began) / (vehicles * steps * cores**2))
        if heyoka:
            for way, size in BATCHES.items():
                cost, count, finite = heyoka.step(size, h, steps, cores)
                seconds[way].append(cost)
                taken[way] = count if finite else np.nan
    return Many(cores, vehicles, h, {way: np.array(costs[1:]) for way, costs in seconds.items()}, taken)


def _column(one: Many) -> str:
    """Return the head of a column: the length of a step, and the number of vehicles where it is not the usual one."""
    return f"{one.h:g} s" + (f", {one.vehicles:,}" if one.vehicles != VEHICLES else "")


def section(name: str, found: Sequence[Many]) -> Section:
    """Return the cost of many vehicles that are stepped together, and the ratio to the best of heyoka's batches."""
    where = "one core" if found[0].cores == 1 else f"{found[0].cores} cores"
    rows = [[f"Many of {name}, {where}, each and step", *(_column(one) for one in found)]]
    for way in found[0].seconds:
        cells = [duration(float(np.median(one.seconds[way]))) for one in found]
        if way in found[0].taken:
            steps = [f"{n:.3g} steps" if np.isfinite(n) else "not finite" for n in (one.taken[way] for one in found)]
            cells = [f"{cell}  {n}" for cell, n in zip(cells, steps, strict=True)]
        rows.append([way, *cells])
    if installed():
        ratios = (digits(one.ratio(LANES, BATCHES)) for one in found)
        rows.append(["lanes / best of heyoka", *ratios])
    return [*rows, ["lanes / one after the other", *(digits(one.ratio(LANES, [OURS])) for one in found)]]
