"""A study: a plan that fits its FMU or vehicle, with all that a process must know to run it."""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.csv_table import read_series
from rov_fmu.io.messages import lines_on, listed, shown
from rov_fmu.io.toml_file import key_line
from rov_fmu.study.expression import CONSTANTS
from rov_fmu.study.expression import TIME as TIMES
from rov_fmu.study.figures import Array, read_expression, unusable
from rov_fmu.study.model import Model, unknown, unsettable
from rov_fmu.study.plan import REASON, RUN, STATUS, TIME, TRAJECTORY, InputSignal, Plan, PlanError
from rov_fmu.study.sampling import Design
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import load_vehicle


@dataclass(frozen=True)
class Study:
    """A plan that fits its FMU, vehicle or system."""

    plan: Plan
    model: Model
    varied: Sequence[str]
    """The variables that get other values in each run."""
    rows: Array
    """Their values: a row for each run."""
    inputs: Mapping[str, Array]
    """The values that are set at the beginning of each step, by variable."""
    recorded: Sequence[str]
    """The variables that are read before the first step and after every step."""
    warnings: Sequence[str]

    @property
    def digest(self) -> str:
        """What a row depends on, beside its own values; the order of [vary] is that of its columns."""
        left_out = {"title", "fmu", "vehicle", "system", "vary_from", "samples", "time_limit", "input_file", "runs"}
        told = self.plan.model_dump(mode="json", by_alias=True, exclude=left_out)
        content = [json.dumps(told).encode(), self.model.content]
        content += [values.tobytes() for values in self.inputs.values()]
        return sha256(b"".join(content)).hexdigest()[:12]


def prepare(plan: Plan, path: Path, model: Model) -> Study:
    """Check that a plan, read from `path`, and what it runs fit. Raises FileError with every reason."""
    has = model.variables
    vehicle = load_vehicle(named_in(path, "vary_from", plan.vary_from, PlanError)) if plan.vary_from else None
    design = Design(plan, path, has, vehicle)
    from_file = _read_inputs(plan, path, has)
    signals = {**plan.inputs, **from_file}
    wrong = [*design.wrong(signals), *_wrong(plan, signals, has, design.names)]
    wrong += [key_line(f"inputs.{name}", "is in input_file, too") for name in from_file if name in plan.inputs]
    if wrong:
        raise PlanError(*lines_on(path, wrong))
    middles = plan.times[:-1] + 0.5 * plan.step
    inputs = {name: _sampled(signal, middles, has[name].start) for name, signal in signals.items()}
    named = {name for text in plan.figures.values() for name in read_expression(text).names} & has.keys()
    recorded = [*dict.fromkeys([*plan.kept, *sorted(named - {*design.names})])]
    names = [name for name, variable in has.items() if variable.causality == "input"]
    told = [*design.warnings()]
    if names and not plan.system and not {*names} & {*inputs, *design.names, *plan.set}:
        told.append(f"the plan gives no input of the FMU ({listed(names[:5])}): all keep their start values")
    return Study(plan, model, design.names, design.rows(), inputs, recorded, told)


def _read_inputs(plan: Plan, path: Path, has: Mapping[str, Variable]) -> dict[str, InputSignal]:
    """Return the inputs in the CSV file of the plan. Raises FileError about the file."""
    if not plan.input_file:
        return {}
    file, between = path.parent / plan.input_file.path, plan.input_file.between
    (_, times), *columns = read_series(file, lambda name: None if name in has else unknown(name, has)).items()
    return {
        name: InputSignal.model_validate(
            {between if has[name].is_continuous else "steps": tuple(zip(times, values, strict=True))}
        )
        for name, values in columns
    }


def _wrong(
    plan: Plan, signals: Mapping[str, InputSignal], has: Mapping[str, Variable], varied: Collection[str]
) -> Iterator[str]:
    """Yield a line for each part of the plan that does not fit, but for what varies."""
    for name, value in plan.set.items():
        if reason := unsettable(name, has) or has[name].wrong(value):
            yield key_line(f"set.{name}", reason, value)
    for name, signal in signals.items():
        if reason := _misfit(name, signal, plan, has):
            yield key_line(f"inputs.{name}", reason)
    for name in plan.kept:
        if name not in has:
            yield key_line("keep.outputs", unknown(name, has))
    for name, text in plan.figures.items():
        strange = sorted(read_expression(text).names - CONSTANTS.keys() - {TIMES} - has.keys())
        if name in {RUN, STATUS, REASON, TRAJECTORY, *varied}:
            yield key_line(f"figures.{name}", "the results have another column of this name")
        elif strange:
            reason = f"{shown(strange[0])} is neither a function nor a variable of the FMU that is a number"
            yield key_line(f"figures.{name}", reason, text)
        elif reason := unusable(text, has, varied, plan.times):
            yield key_line(f"figures.{name}", reason, text)
    if taken := {RUN, TIME} & {*plan.kept}:
        yield key_line("keep.outputs", f"the results have another column {taken.pop()}")


def _misfit(name: str, signal: InputSignal, plan: Plan, has: Mapping[str, Variable]) -> str:
    """Return why a signal cannot be an input, or an empty text; also of jumps that would be delayed."""
    if name not in has:
        return unknown(name, has)
    if has[name].causality != "input":
        return f"is no input of the FMU; its causality is {has[name].causality}"
    if name in plan.set:
        return "is given in [set] too"
    if signal.ramps and not has[name].is_continuous:
        return "must be steps, because the variable is not continuous"
    points = signal.points
    for n in signal.jumps(has[name].start):
        if plan.start_time < points[n][0] < plan.stop_time and plan.step_at(points[n][0]) is None:
            return f"a jump at {points[n][0]:g} s must be at a multiple of step = {plan.step:g} s after the start"
    return next((reason for _, value in points if (reason := has[name].wrong(value))), "")


def _sampled(signal: InputSignal, times: Array, before: float) -> Array:
    """Return the signal at these times, the middles of the steps; `before` is the value before its first point.

    An input is held over a step. With the value at the middle of the step, the error is of second order in the step.
    """
    at, values = np.array(signal.points, np.float64).T
    held: Array = np.append(before, values)[np.searchsorted(at, times, side="right")]
    return np.interp(times, at, values, left=before) if signal.ramps else held
