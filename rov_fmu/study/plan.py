"""The plan of a study: the TOML file that says what is run, what is varied, what is kept and what is computed."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, BeforeValidator, Field

from rov_fmu.io.file_kinds import PLAN, check_suffix
from rov_fmu.io.messages import FileError, lines_on, listed
from rov_fmu.io.toml_file import (
    AS_TUPLE,
    NOT_BLANK,
    Beside,
    Finite,
    Name,
    Strict,
    key_line,
    read_checked,
    rule,
)
from rov_fmu.study.figures import read_expression

RUN, STATUS, REASON = "run", "status", "reason"
"""The columns that the results of every study have."""
TRAJECTORY, TIME = "trajectory", "t"
"""The column of the trajectories, and the part of it with their times."""
DONE, INCOMPLETE, FAILED = "done", "incomplete", "failed"
"""The statuses of a run: complete; it ended, but a figure cannot be computed; it did not end."""
RUNS, STUDY = "runs", "study.json"
_MOST_RUNS = 100_000_000
_MOST_STEPS = 10_000_000
_MOST_NAMED = 10_000
"""The largest number of variables in a table of a plan."""
_DRAWN = {"runs", "seed", "sampler", "vary", "vary_from"}
"""The keys about values that a study draws itself."""
_ALWAYS = -1e300
"""A time before any start."""


class PlanError(FileError):
    """A plan cannot be carried out; the text has a line for each reason."""


_SOME = rule("must have an entry", bool)
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_Limits = Annotated[tuple[Finite, Finite], AS_TUPLE, rule("must be [low, high]", lambda ends: ends[0] < ends[1])]
_List = Annotated[tuple[Finite, ...], AS_TUPLE, _SOME]


class Normal(Strict):
    """A normal distribution, cut off where the FMU's variable has its bounds."""

    mean: Finite
    """The mean, in the variable's unit."""
    sd: Positive
    """The standard deviation, in the variable's unit."""


class LogNormal(Strict):
    """The distribution of a positive number whose logarithm is normal, cut off at the variable's bounds."""

    median: Positive
    """The median, in the variable's unit."""
    sd: Positive
    """The standard deviation of the natural logarithm."""


class Spaced(Strict):
    """Evenly spaced numbers from one to another."""

    first: Finite = Field(alias="from")
    """The first number."""
    last: Finite = Field(alias="to")
    """The last number."""
    count: Annotated[int, Field(ge=2, le=1_000_000)]
    """How many numbers, including both ends."""

    @property
    def values(self) -> tuple[float, ...]:
        """All numbers of the range."""
        intervals = self.count - 1
        return tuple(((intervals - n) * self.first + n * self.last) / intervals for n in range(self.count))


class Varied(Strict):
    """How a variable of the FMU differs from run to run; exactly one of these keys is given."""

    normal: Normal | None = None
    """{ mean = ..., sd = ... }."""
    lognormal: LogNormal | None = None
    """{ median = ..., sd = ... }, the sd of the logarithm."""
    uniform: _Limits | None = None
    """[low, high]."""
    values: _List | None = None
    """A list; each is as likely as the others."""
    range: Spaced | None = None
    """{ from = ..., to = ..., count = ... }; each is as likely as the others."""

    one_of = ("normal", "lognormal", "uniform", "values", "range")

    @property
    def choices(self) -> tuple[float, ...] | None:
        """The numbers of a list or a range."""
        return self.range.values if self.range else self.values

    @property
    def extremes(self) -> Sequence[float]:
        """The values that the variable must be able to have."""
        if self.normal:
            return [self.normal.mean]
        return [self.lognormal.median] if self.lognormal else self.choices or self.uniform or ()


def _held(given: Any) -> Any:
    """Turn a number into a signal that holds it from the start to the end; true and false are 1 and 0."""
    if isinstance(given, int | float):
        return {"steps": [[_ALWAYS, float(given)]]}
    if not isinstance(given, dict | InputSignal):
        raise ValueError("must be a number, { steps = [[time, value], ...] } or { ramps = ... }")
    return given


def _as_number(given: Any) -> Any:
    """Turn true and false into 1 and 0, the values of a Boolean variable."""
    return float(given) if isinstance(given, bool) else given


def _in_order(points: "Points") -> "Points":
    for before, after in pairwise(points):
        if after[0] < before[0]:
            raise ValueError(f"the time must not go back, as it does from {before[0]:g} to {after[0]:g}")
    return points


Points = Annotated[tuple[Annotated[tuple[Finite, Finite], AS_TUPLE], ...], AS_TUPLE, _SOME, AfterValidator(_in_order)]
"""[time, value] pairs."""


class InputSignal(Strict):
    """An input over time, given by points between which it is held or follows a straight line.

    Before the first point it has the start value of the FMU, and after the last point the value of that point.
    """

    steps: Points | None = None
    """[[time, value], ...]: each value is held until the next time. The times are communication points."""
    ramps: Points | None = None
    """[[time, value], ...]: straight lines between the points; two points with the same time make a jump, at a
    communication point. The FMU gets the value at the middle of each step."""

    one_of = ("steps", "ramps")

    @property
    def points(self) -> Points:
        """The points of either kind."""
        return self.steps or self.ramps or ()

    def jumps(self, before: float) -> Iterator[int]:
        """Yield the numbers of the points at which the value jumps; `before` is the value before the first point."""
        last: tuple[float, float] | None = None
        for n, (time, value) in enumerate(self.points):
            if value != (last[1] if last else before) and (self.steps or last is None or time == last[0]):
                yield n
            last = time, value


class InputFile(Strict):
    """A CSV file with the column `time` (s) and one for each input."""

    path: Beside
    """A file in the folder of the plan, or in a folder inside it."""
    between: Literal["steps", "ramps"] = "ramps"
    """steps: a row is held until the next one; ramps: there are straight lines between the rows."""


_ONCE = rule("must name each variable once", lambda names: len({*names}) == len(names))


class Keep(Strict):
    """The trajectories that are kept; none without this table."""

    outputs: Annotated[tuple[str, ...], AS_TUPLE, _SOME, _ONCE]
    """Names of variables."""
    every: Positive | None = None
    """The time between kept points, s; a multiple of the step. The default is every step."""


def _expression(text: str) -> str:
    read_expression(text)
    return text


def _drawn_here(sampler: object) -> object:
    """Refuse the sampler for Sobol indices, which earlier versions had."""
    if sampler == "saltelli":
        raise ValueError('write samples = "design.csv", a table of SALib: docs/studies.md shows how')
    return sampler


class Plan(Strict):
    """A study: many runs of one vehicle, of one FMU, or of one system of FMUs."""

    one_of = ("fmu", "vehicle", "system")

    @staticmethod
    def hint(key: str, /) -> str:
        """Return what to write in place of keep.at, which earlier versions had."""
        return ": write every = 1.0, for example, and take those times of the trajectories" if key == "at" else ""

    title: Name | None = None
    """The heading of the page."""
    fmu: Beside | None = None
    """An FMU for Co-Simulation in the folder of the plan. A plan has this, `vehicle` or `system`."""
    vehicle: Beside | None = None
    """A vehicle file beside the plan, or the name of a vehicle that ships. It runs without an FMU."""
    system: Beside | None = None
    """A system (SSP) in the folder of the plan. Its variables are "component.variable"."""
    start_time: Finite = 0.0
    """s."""
    stop_time: Finite
    """s; a whole number of steps from the start."""
    step: Positive
    """Communication step, s: inputs are set, and outputs read, once a step."""
    tolerance: Positive | None = None
    """The relative tolerance, for an FMU whose solver uses one."""
    time_limit: Annotated[float, Field(gt=0.0, le=1e6)] = 300.0
    """The time that a run of an FMU may take, s; a run that takes longer fails."""
    runs: Annotated[int, Field(ge=1, le=_MOST_RUNS)] | None = None
    """The number of runs. A grid has one for each of its points, and `samples` one for each row."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """The parameters of a run depend only on this and on the run's number."""
    sampler: Annotated[Literal["grid", "sobol", "latin-hypercube", "random"], BeforeValidator(_drawn_here)] = "sobol"
    """The method by which the values are drawn."""
    samples: Beside | None = None
    """A CSV file with a column for each varied variable and a row for each run, such as a design of SALib."""
    vary_from: Beside | None = None
    """A vehicle file or name. Its coefficients vary with their errors and correlations, except for those in [vary] and
    [set]."""
    vary: dict[str, Varied] = Field({}, max_length=_MOST_NAMED)
    """The variables that differ from run to run. An input that varies is held during a run."""
    set: dict[str, Annotated[Finite, BeforeValidator(_as_number)]] = Field({}, max_length=_MOST_NAMED)
    """Start values of variables for all runs, in place of the FMU's."""
    inputs: dict[str, Annotated[InputSignal, BeforeValidator(_held)]] = Field({}, max_length=_MOST_NAMED)
    """The inputs over time: each is a number, steps or ramps."""
    input_file: InputFile | None = None
    """Inputs from a CSV file."""
    keep: Keep | None = None
    """The trajectories that are kept."""
    figures: dict[
        Annotated[str, NOT_BLANK],
        Annotated[str, Field(min_length=1, max_length=2000), AfterValidator(_expression)],
    ] = Field({})
    """Expressions over the outputs, by the names of their columns."""

    @property
    def files(self) -> Iterator[str]:
        """The files that it names, from its folder; a vehicle that ships is none."""
        file = self.input_file and self.input_file.path
        return (name for name in (self.fmu, self.vehicle, self.system, self.vary_from, self.samples, file) if name)

    @property
    def steps(self) -> int:
        """The number of steps of a run."""
        return round((self.stop_time - self.start_time) / self.step)

    @property
    def points(self) -> int:
        """The number of points of a grid."""
        return prod(len(varied.choices or ()) for varied in self.vary.values())

    def step_at(self, time: float) -> int | None:
        """Return the number of steps until a time of the run, or None if it is not a multiple of the step."""
        steps = (time - self.start_time) / self.step
        return round(steps) if _whole(steps) and 0 <= round(steps) <= self.steps else None

    @property
    def times(self) -> npt.NDArray[np.float64]:
        """The times of the communication points, s."""
        return self.start_time + self.step * np.arange(self.steps + 1, dtype=np.float64)

    @property
    def kept(self) -> tuple[str, ...]:
        """The outputs whose trajectories are kept."""
        return self.keep.outputs if self.keep else ()

    @property
    def kept_points(self) -> Sequence[int]:
        """The numbers of the communication points at which they are kept."""
        if self.keep is None:
            return ()
        return range(0, self.steps + 1, round(self.keep.every / self.step) if self.keep.every else 1)


def _whole(steps: float) -> bool:
    """True when a quotient is a whole number, within rounding."""
    return abs(steps - round(steps)) <= 1e-9 * max(1.0, abs(steps))


def load_plan(path: Path) -> Plan:
    """Read a plan. Raises PlanError, also with a line for each contradiction between its keys."""
    check_suffix(path, PLAN, PlanError)
    plan = read_checked(path, PLAN, Plan, PlanError)
    if wrong := [*_contradictions(plan)]:
        raise PlanError(*lines_on(path, wrong))
    return plan


def _contradictions(plan: Plan) -> Iterator[str]:
    if plan.stop_time <= plan.start_time:
        yield key_line("stop_time", f"must be after start_time = {plan.start_time:g}", plan.stop_time)
    elif not _whole((plan.stop_time - plan.start_time) / plan.step):
        yield key_line(
            "stop_time", f"must be a whole number of steps of {plan.step:g} s after the start", plan.stop_time
        )
    elif plan.steps > _MOST_STEPS:
        yield key_line("step", f"must divide a run into at most {_MOST_STEPS} steps", plan.step)
    elif plan.keep and plan.keep.every and plan.step_at(plan.start_time + plan.keep.every) is None:
        yield key_line("keep.every", f"must be a multiple of step = {plan.step:g}, and within a run", plan.keep.every)
    if plan.sampler == "grid" and plan.runs is not None:
        yield key_line("runs", "a grid has one run for each point: leave this key out", plan.runs)
    if plan.sampler == "grid" and plan.points > _MOST_RUNS:
        yield key_line("vary", f"a grid must have at most {_MOST_RUNS} points, and not {plan.points:.3g}")
    if plan.samples and (other := sorted(plan.model_fields_set & _DRAWN)):
        yield key_line("samples", f"has all that varies: leave {listed(other)} out", plan.samples)
    elif plan.sampler != "grid" and not plan.samples and plan.runs is None:
        yield "runs: this key is missing"
    if not plan.keep and not plan.figures:
        yield "must have [keep] or [figures]. Otherwise nothing of a run is stored"
