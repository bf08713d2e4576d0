"""A study, which is a plan with its FMU: check that they fit, and collect what the workers must know."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import Self

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.csv_table import read_series
from rov_fmu.io.messages import lines_on, shown
from rov_fmu.io.toml_file import key_line
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
)
from rov_fmu.study.plan.sampling import Design, some_of
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import load_vehicle


@dataclass(frozen=True)
class Study:
    """A plan that fits its FMU: everything that a worker must know, sent to each worker once."""

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
    about: Mapping[str, Any]
    """The description of the study in its results, as JSON values."""

    def unpacked(self, folder: Path) -> Self:
        """Unpack the FMU into a folder, and return the study without its content. Raises FileError."""
        self.model.unpack(folder)
        return replace(self, model=replace(self.model, content=b""))


def prepare(plan: Plan, path: Path, model: Model) -> tuple[Study, Design]:
    """Check that a plan, read from `path`, fits an FMU. Raises FileError with every reason."""
    has = model.variables
    vehicle = load_vehicle(named_in(path, "vary_from", plan.vary_from, PlanError)) if plan.vary_from else None
    design = Design(plan, has, vehicle)
    from_file, wrong_rows = _read_inputs(plan, path, has)
    wrong = lines_on(path, [*design.check(plan.inputs | from_file), *_check(plan, has, design.names)])
    if wrong or wrong_rows:
        raise PlanError(*wrong, *wrong_rows)
    whole = plan.model_copy(update={"inputs": plan.inputs | from_file})
    middles = plan.times[:-1] + 0.5 * plan.step
    inputs = {name: _sampled(signal, middles, has[name].start) for name, signal in whole.inputs.items()}
    named = {name for text in plan.figures.values() for name in read_expression(text).names} & has.keys()
    angles = ("phi", "theta") if {"phi", "theta", "psi"} <= has.keys() - {*design.names} else ()
    recorded = [*dict.fromkeys([*plan.kept, *sorted({*named, *angles} - {*design.names})])]
    told = [has[name] for name in (*design.names, *recorded)]
    about = {
        "runs": design.runs,
        "plan": whole.mark | design.mark,
        "fmu": model.digest,
        "engine": "lanes" if model.vehicle else "fmu",
        "vehicle": plan.vehicle,
        "columns": {"parameters": design.names, "figures": [*plan.figures], "outputs": plan.kept},
        "model": model.name,
        "title": plan.title,
        "units": {variable.name: variable.unit or "1" for variable in told},
        "descriptions": {variable.name: variable.description for variable in told},
        "groups": design.groups,
        "warnings": [*_without_inputs(model, {*inputs, *design.names, *plan.set}), *design.warnings()],
    }
    return Study(model, plan, design.names, inputs, recorded, angles, about), design


def _without_inputs(model: Model, given: Collection[str]) -> Iterator[str]:
    """Yield a sentence if no input of the FMU is given, because then a vehicle usually stays where it is."""
    names = [name for name, variable in model.variables.items() if variable.causality == "input"]
    if not names:
        yield f"{model.name} has no inputs: its parameters and start values alone determine its runs"
    elif not {*names} & {*given}:
        yield f"the plan gives no input of the FMU ({some_of(names)}): all keep their start values"


def _read_inputs(plan: Plan, path: Path, has: Mapping[str, Variable]) -> tuple[dict[str, InputSignal], list[str]]:
    """Return the inputs in the CSV file of the plan, and a line for each that does not fit, with its column and row.

    Raises FileError about the file itself.
    """
    if not plan.input_file:
        return {}, []
    file, between = path.parent / plan.input_file.path, plan.input_file.between
    table = read_series(file, lambda name: None if name in has else unknown(name, has))
    (_, times), *columns = table.items()
    found, wrong = dict[str, InputSignal](), []
    for name, values in columns:
        kind = between if has[name].is_continuous else "steps"
        signal = found[name] = InputSignal.model_validate({kind: tuple(zip(times, values, strict=True))})
        taken = [(None, "is given in [inputs] too")] if name in plan.inputs else []
        for n, reason in taken or _misfits(name, signal, plan, has):
            where = f"column {shown(name)}"
            if n is not None:
                where = f"line {table.lines[n]}, {where} = {values[n]:g} at {times[n]:g} s"
            wrong.append(f"{file}: {where}: {reason}")
    return found, wrong


# ---- Checks ----------------------------------------------------------------------------------------------------------


def _check(plan: Plan, has: Mapping[str, Variable], varied: Collection[str]) -> Iterator[str]:
    """Yield a line for each part of the plan that does not fit, but for what varies."""
    for name, value in plan.set.items():
        if reason := unsettable(name, has) or has[name].wrong(value):
            yield key_line(f"set.{name}", reason, value)
    for name, signal in plan.inputs.items():
        for n, reason in _misfits(name, signal, plan, has):
            yield key_line(f"inputs.{name}", reason, *signal.value_given(n))
    for name in plan.kept:
        if name not in has:
            yield key_line("keep.outputs", unknown(name, has))
    for name, text in plan.figures.items():
        key = f"figures.{name}"
        strange = sorted(read_expression(text).names - CONSTANTS.keys() - {TIMES} - has.keys())
        if name in {RUN, STATUS, REASON, TRAJECTORY, *varied}:
            yield key_line(key, "the results have another column of this name")
        elif strange:
            reason = f"{shown(strange[0])} is neither a function nor a variable of the FMU that is a number"
            yield key_line(key, meaning(strange[0]) or reason, text)
        elif reason := unusable(text, has, varied, plan.times):
            yield key_line(key, reason, text)
    if taken := {RUN, TIME} & {*plan.kept}:
        yield key_line("keep.outputs", f"the results have another column {taken.pop()}")


def _misfits(
    name: str, signal: InputSignal, plan: Plan, has: Mapping[str, Variable]
) -> Iterator[tuple[int | None, str]]:
    """Yield why a signal cannot be an input: the number of a point, or None for the whole signal, and the reason.

    Of values out of bounds, and of jumps that would be delayed because no step begins there, the first one is told.
    """
    if name not in has:
        yield None, unknown(name, has)
    elif has[name].causality != "input":
        yield None, f"is no input of the FMU; its causality is {has[name].causality}"
    elif name in plan.set:
        yield None, "is given in [set] too"
    elif signal.ramps and not has[name].is_continuous:
        yield None, "must be steps, because the variable is not continuous"
    else:
        points, start = signal.points, has[name].start
        reasons = ((n, has[name].wrong(value)) for n, (_, value) in enumerate(points))
        yield from [(n, reason) for n, reason in reasons if reason][:1]
        jumps = [n for n in signal.jumps(start) if plan.start_time < points[n][0] < plan.stop_time]
        for n in [n for n in jumps if plan.step_at(points[n][0]) is None][:1]:
            was = points[n - 1][1] if n else start
            rule = f"must be at a communication point, a multiple of step = {plan.step:g} s after the start"
            yield n, f"a jump, as from {was:g} here, {rule}"


# ---- Over time -------------------------------------------------------------------------------------------------------


def _sampled(signal: InputSignal, times: Array, before: float) -> Array:
    """Return the signal at these times, the middles of the steps; `before` is the value before its first point.

    An input is held over a step. With the value at the middle of the step, the error is of second order in the step.
    """
    at, values = np.array(signal.points, np.float64).T
    held: Array = np.append(before, values)[np.searchsorted(at, times, side="right")]
    return np.interp(times, at, values, left=before) if signal.ramps else held
