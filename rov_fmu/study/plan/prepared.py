"""Combine a plan with its FMU: report what does not fit, and collect what the workers must know."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from typing_extensions import Self

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.csv_table import read_series
from rov_fmu.io.messages import FileError, lines_on, shown
from rov_fmu.io.toml_file import key_line
from rov_fmu.study.plan.estimates import Estimates, some_of
from rov_fmu.study.plan.expression import CONSTANTS
from rov_fmu.study.plan.expression import TIME as TIMES
from rov_fmu.study.plan.figures import Array, meaning, read_expression, unusable
from rov_fmu.study.plan.model import Model, unknown, unsettable
from rov_fmu.study.plan.plan import (
    REASON,
    RUN,
    STATUS,
    TIME,
    TRAJECTORY,
    InputSignal,
    Plan,
    PlanError,
    Varied,
    check_plan,
)
from rov_fmu.study.plan.sampling import Design
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import load_vehicle

_MOST_DRAWN = 50_000_000
"""The largest number of values in a Latin hypercube, which is drawn as a whole: they take 2 GB for some time."""
_TRIALS = 8
"""The number of runs that are tried until one ends, to find out whether the FMU can be reset."""


@dataclass(frozen=True)
class Study:
    """A plan that fits its FMU: everything that a worker must know, sent to each worker once."""

    key: str
    """Distinguishes this study from others on the same workers."""
    model: Model
    plan: Plan
    varied: Sequence[str]
    """The variables that get other values in each run."""
    inputs: Mapping[str, Array]
    """The values that are set at the beginning of each step, by variable."""
    recorded: Sequence[str]
    """The variables that are read before the first step and after every step."""
    angles: Sequence[str]
    """The recorded angles that tell whether a vehicle turns over; none for an FMU without an attitude."""
    trials: Array
    """The values of the first runs, with which it is found out whether the FMU can be reset."""
    about: Mapping[str, Any]
    """The description of the study in its results, as JSON values."""

    def unpacked(self, folder: Path) -> Self:
        """Unpack the FMU into a folder, and return the study without its content. Raises FileError."""
        self.model.unpack(folder)
        return replace(self, model=replace(self.model, content=b""))


def prepare(plan: Plan, path: Path, model: Model) -> tuple[Study, Design]:
    """Check that a plan, read from `path`, fits an FMU. Raises PlanError with every reason."""
    has = model.variables
    vehicle = load_vehicle(named_in(path, "vary_from", plan.vary_from, PlanError)) if plan.vary_from else None
    estimates = Estimates(plan, vehicle, has)
    own, unread = [*check_plan(plan)], []
    from_file: Mapping[str, InputSignal] = {}
    lines: Sequence[int] = ()
    try:
        from_file, lines = _file_inputs(plan, path, model)
    except FileError as error:
        unread = [str(error)]
    times = np.zeros(0) if own else plan.times
    words = [*own, *estimates.check(), *_check(plan, model, estimates.names, from_file, times)]
    wrong = lines_on(path, words) + unread
    if plan.input_file:
        file = path.parent / plan.input_file.path
        wrong += [f"{file}: {line}" for line in _check_rows(plan, has, from_file, lines)]
    if wrong:
        raise PlanError(*wrong)
    design = Design(plan, has, estimates.known)
    whole = plan.model_copy(update={"inputs": {**plan.inputs, **from_file}})
    middles = times[:-1] + 0.5 * plan.step
    inputs = {name: _sampled(signal, middles, has[name].start) for name, signal in whole.inputs.items()}
    named = {name for text in plan.figures.values() for name in read_expression(text).names} & has.keys()
    angles = ("phi", "theta") if {"phi", "theta", "psi"} <= has.keys() - {*design.names} else ()
    recorded = [*dict.fromkeys([*plan.kept, *sorted({*named, *angles} - {*design.names})])]
    shown = [has[name] for name in (*design.names, *recorded)]
    about = {
        "runs": design.runs,
        "plan": whole.mark | estimates.mark,
        "fmu": model.digest,
        "engine": "lanes" if model.vehicle else "fmu",
        "vehicle": plan.vehicle,
        "columns": {"parameters": design.names, "figures": [*plan.figures], "outputs": plan.kept},
        "model": model.name,
        "title": plan.title,
        "units": {variable.name: variable.unit or "1" for variable in shown},
        "descriptions": {variable.name: variable.description for variable in shown},
        "groups": design.groups,
        "warnings": [
            *_without_inputs(model, {*inputs, *design.names, *plan.set}),
            *estimates.warnings(),
            *design.warnings(),
        ],
    }
    trials = design.rows(0, min(_TRIALS, design.runs))
    key = f"rov-fmu-{uuid4().hex}"
    return Study(key, model, plan, design.names, inputs, recorded, angles, trials, about), design


def _without_inputs(model: Model, given: Collection[str]) -> Iterator[str]:
    """Yield a sentence if no input of the FMU is given, because then a vehicle usually stays where it is."""
    names = [name for name, variable in model.variables.items() if variable.causality == "input"]
    if not names:
        yield f"{model.name} has no inputs: its parameters and start values alone determine its runs"
    elif not {*names} & {*given}:
        yield f"the plan gives no input of the FMU ({some_of(names)}): all keep their start values"


def _file_inputs(plan: Plan, path: Path, model: Model) -> tuple[dict[str, InputSignal], Sequence[int]]:
    """Read the inputs in the CSV file of the plan, and the line of each row. Raises FileError."""
    if not plan.input_file:
        return {}, ()
    file = path.parent / plan.input_file.path

    def why_wrong(name: str) -> str | None:
        return None if name in model.variables else unknown(name, model.variables)

    table = read_series(file, why_wrong)
    (_, times), *columns = table.items()
    found = {}
    for name, values in columns:
        points = tuple(zip(times, values, strict=True))
        held = plan.input_file.between == "steps" or not model.variables[name].is_continuous
        found[name] = InputSignal(steps=points) if held else InputSignal(ramps=points)
    return found, table.lines


# ---- Checks ----------------------------------------------------------------------------------------------------------


def _check(
    plan: Plan, model: Model, known: Sequence[str], from_file: Mapping[str, InputSignal], times: Array
) -> Iterator[str]:
    """Yield a line for each part of the plan that does not fit; `known` names what varies in addition to [vary]."""
    has = model.variables
    for name, varied in plan.vary.items():
        key = f"vary.{name}"
        if reason := unsettable(name, has):
            yield key_line(key, reason)
        elif name in plan.set or name in plan.inputs or name in from_file:
            yield key_line(key, "is given in [set] or [inputs] too")
        elif plan.sampler == "grid" and varied.choices is None:
            yield key_line(key, "a grid needs values or a range", varied.model_dump(exclude_none=True))
        else:
            for value in _extremes(varied):
                if reason := has[name].wrong(value):
                    yield key_line(key, reason, value)
                    break
    yield from _check_size(plan, len({*known, *plan.vary}))
    for name, value in plan.set.items():
        if reason := unsettable(name, has) or has[name].wrong(value):
            yield key_line(f"set.{name}", reason, value)
    yield from _check_inputs(plan, has)
    for name in plan.kept:
        if name not in has:
            yield key_line("keep.outputs", unknown(name, has))
    yield from _check_figures(plan, has, {*known, *plan.vary}, times)


def _check_size(plan: Plan, varied: int) -> Iterator[str]:
    """Yield a line if nothing varies, or if too much is drawn at once."""
    if not (varied or plan.vary_from) and plan.sampler != "grid":
        yield 'vary: nothing varies: write [vary], or sampler = "grid" for the one run'
    if plan.sampler == "latin-hypercube" and (plan.runs or 0) * varied > _MOST_DRAWN:
        most = f"at most {_MOST_DRAWN // varied} runs with {varied} variables"
        yield key_line("runs", f"a Latin hypercube is drawn as a whole, {most}", plan.runs)


def _extremes(varied: Varied) -> Sequence[float]:
    """Return the values of a distribution that the variable must be able to have."""
    if varied.normal:
        return [varied.normal.mean]
    if varied.lognormal:
        return [varied.lognormal.median]
    return varied.choices or varied.uniform or ()


def _check_inputs(plan: Plan, has: Mapping[str, Variable]) -> Iterator[str]:
    """Yield a line for each input in the plan that does not fit."""
    for name, signal in plan.inputs.items():
        for n, reason in _misfits(name, signal, plan, has):
            given = [] if n is None else [signal.value_given(n)]
            yield key_line(f"inputs.{name}", reason, *given)


def _check_rows(
    plan: Plan, has: Mapping[str, Variable], from_file: Mapping[str, InputSignal], lines: Sequence[int]
) -> Iterator[str]:
    """Yield a line for each input in a file that does not fit, with its column and the line of its row."""
    for name, signal in from_file.items():
        taken = [(None, "is given in [inputs] too")] if name in plan.inputs else []
        for n, reason in taken or _misfits(name, signal, plan, has):
            where = f"column {shown(name)}"
            if n is not None:
                time, value = signal.points[n]
                where = f"line {lines[n]}, {where} = {value:g} at {time:g} s"
            yield f"{where}: {reason}"


def _misfits(
    name: str, signal: InputSignal, plan: Plan, has: Mapping[str, Variable]
) -> Iterator[tuple[int | None, str]]:
    """Yield why a signal cannot be an input: the number of a point, or None for the whole signal, and the reason."""
    if name not in has:
        yield None, unknown(name, has)
    elif has[name].causality != "input":
        yield None, f"is no input of the FMU; its causality is {has[name].causality}"
    elif name in plan.set:
        yield None, "is given in [set] too"
    elif signal.ramps and not has[name].is_continuous:
        yield None, "must be steps, because the variable is not continuous"
    else:
        yield from _out_of_bounds(signal, has[name])
        yield from _misplaced_jumps(signal, plan, has[name].start)


def _out_of_bounds(signal: InputSignal, variable: Variable) -> Iterator[tuple[int, str]]:
    """Yield the number of the first point whose value is not possible, and the reason."""
    for n, (_, value) in enumerate(signal.points):
        if reason := variable.wrong(value):
            yield n, reason
            return


def _misplaced_jumps(signal: InputSignal, plan: Plan, before: float) -> Iterator[tuple[int, str]]:
    """Yield the number of the first jump that would be delayed, because no step begins there, and the rule."""
    for n in signal.jumps(before):
        time = signal.points[n][0]
        if plan.start_time < time < plan.stop_time and plan.step_at(time) is None:
            was = signal.points[n - 1][1] if n else before
            rule = (
                f"a jump, as from {was:g} here, must be at a communication point, a multiple of step = {plan.step:g} s"
            )
            yield n, f"{rule} after the start"
            return


def _check_figures(plan: Plan, has: Mapping[str, Variable], varied: set[str], times: Array) -> Iterator[str]:
    for name, text in plan.figures.items():
        if name in {RUN, STATUS, REASON, TRAJECTORY} | varied:
            yield key_line(f"figures.{name}", "the results have another column of this name")
            continue
        if strange := sorted(read_expression(text).names - CONSTANTS.keys() - {TIMES} - has.keys()):
            reason = f"{shown(strange[0])} is neither a function nor a variable of the FMU that is a number"
            yield key_line(f"figures.{name}", meaning(strange[0]) or reason, text)
        elif times.size and (reason := unusable(text, has, varied, times)):
            yield key_line(f"figures.{name}", reason, text)
    if taken := {RUN, TIME} & {*plan.kept}:
        yield key_line("keep.outputs", f"the results have another column {taken.pop()}")


# ---- Over time -------------------------------------------------------------------------------------------------------


def _sampled(signal: InputSignal, times: Array, before: float) -> Array:
    """Return the signal at these times, the middles of the steps; `before` is the value before its first point.

    An input is held over a step. With the value at the middle of the step, the error is of second order in the step.
    """
    at, values = np.array(signal.points, np.float64).T
    held: Array = np.append(before, values)[np.searchsorted(at, times, side="right")]
    return np.interp(times, at, values, left=before) if signal.ramps else held
