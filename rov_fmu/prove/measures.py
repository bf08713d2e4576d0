"""What is measured of an FMU, one function for each claim. A function returns the evidence."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, nan
from typing import Any, Literal

import numpy as np

from rov_fmu.fmus.instance import Array, RunError
from rov_fmu.io.child_process import ChildError
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import brief, capitalized, listed
from rov_fmu.prove.proof import compare, least_divisor
from rov_fmu.prove.runs import Reaction
from rov_fmu.prove.subject import Subject

Result = Literal["holds", "fails", "measured", "does not apply"]
"""`measured` is a fact without a promise: what a step costs, or what an FMU accepts that promised nothing."""
_STEPS = (2, 5, 10, 50)
"""The numbers of communication steps in each piece of a simulation that are compared with one step."""
_RUNS, _PROCESSES, _STEPS_OF_RUN = 100, 2, 10
_COST_SECONDS = 1.0
_WAIT = 5.0
"""The longest time for an answer to something impossible, s."""


@dataclass(frozen=True)
class Evidence:
    """What was found about a claim."""

    result: Result
    sentence: str
    figure: str = ""
    """The number that says the most, in a few characters."""
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    """A table of details, with its heads."""
    curve: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """What the picture of the claim shows."""


def does_not_apply(reason: str) -> Evidence:
    return Evidence("does not apply", f"{capitalized(reason)}.")


def in_short(value: float) -> str:
    """Return a relative deviation with two digits, or 0."""
    return f"{value:.1e}" if value else "0"


def holds_if(holds: bool) -> Result:
    return "holds" if holds else "fails"


# ---- Experiments -----------------------------------------------------------------------------------------------------


def expected(subject: Subject) -> Evidence:
    """Compare the FMU with the results that it carries."""
    if not subject.experiments:
        return does_not_apply("the FMU carries no expected results (FMI-LS-REF)")
    findings = compare(subject)
    of_each = grouped((f.experiment, f) for f in findings).values()
    worst = [max(own, key=lambda f: f.deviation / f.tolerance) for own in of_each]
    wrong = [f for f in findings if not f.passed]
    tolerances, deviations = [f.tolerance for f in worst], [f.deviation for f in worst]
    count = f"{len(worst)} experiment{'s' * (len(worst) > 1)}"
    words = f"{len(findings) - len(wrong)} of {len(findings)} results of {count} are as expected"
    words += f", within {max(tolerances):.0e} of the largest value of each variable."
    for told in dict.fromkeys(experiment.told for experiment in subject.experiments if experiment.told):
        words += f" The FMU says of them: {told.rstrip('.')}."
    if wrong:
        f = wrong[0]
        words += f" Experiment {f.experiment}: {f.error or f'{f.variable} deviates by {in_short(f.deviation)}'}."
    rows = [(f.experiment, f.error or f.variable, in_short(f.deviation), f"{f.tolerance:.0e}") for f in worst]
    return Evidence(
        holds_if(not wrong),
        words,
        in_short(max(deviations)),
        ("Experiment", "Worst variable", "Deviation", "Tolerance"),
        rows if len(rows) <= 12 or wrong else (),
        {"deviations": deviations, "tolerance": tolerances},
    )


# ---- Runs ------------------------------------------------------------------------------------------------------------


def step_size(subject: Subject) -> Evidence:
    """Compare several communication steps with one, while the inputs are held."""
    if subject.obstacle:
        return does_not_apply(subject.obstacle)
    if not subject.description.coSimulation.canHandleVariableCommunicationStepSize:
        return does_not_apply("the FMU says that it needs communication steps of one size")
    if sampled := [v.name for v in map(subject.variables.get, subject.plan.outputs) if v and v.is_sampled]:
        return does_not_apply(f"the FMU makes {listed(sampled)} anew at each communication step (they are discrete)")
    plan, refused = subject.plan, ""
    ends = dict[int, Array]()
    with subject.runs() as child:
        for steps in (1, *_STEPS):
            try:
                ends[steps] = child.call("run", plan, steps)[steps::steps]
            except RunError as error:
                refused = f" It refuses {steps} in each piece: {error}."
    if len(ends) < 2:
        return does_not_apply(f"the FMU cannot be run with communication steps of several sizes.{refused.rstrip('.')}")
    (least, first), *others = ends.items()
    off = {steps: _deviation(subject, values, first) for steps, values in others}
    largest, allowed = max(off.values()), subject.allowed
    pieces = f"each of the {len(plan.pieces)} pieces with held inputs" if len(plan.pieces) > 1 else "the run"
    begin = "one step" if least == 1 else f"{least} steps"
    words = f"{subject.words}: {listed(map(str, off))} communication steps in {pieces} end where {begin} ends, "
    words += f"within {in_short(largest)} of the largest value; {allowed:.0e} is allowed.{refused}"
    return Evidence(
        holds_if(largest <= allowed),
        capitalized(words),
        in_short(largest),
        curve={"steps": [*off], "deviations": [*off.values()], "allowed": [allowed]},
    )


def _deviation(subject: Subject, values: Array, reference: Array) -> float:
    """Return the largest deviation, relative to the largest value of a variable or to 1 % of its nominal value."""
    least = [least_divisor(subject.variables[name]) for name in subject.plan.outputs]
    scale = np.maximum(np.abs(reference).max(axis=0), least)
    same = (values == reference) | (np.isnan(values) & np.isnan(reference))
    off = float(np.where(same, 0.0, np.abs(values - reference) / scale).max())
    return off if isfinite(off) else inf


def repeatability(subject: Subject) -> Evidence:
    """Repeat a run in new instances of several processes, and compare the bytes of all results."""
    if subject.obstacle:
        return does_not_apply(subject.obstacle)
    plan = subject.plan
    first: Array | None = None
    same, largest = 0, 0.0
    for _ in range(_PROCESSES):
        with subject.runs() as child:
            for _ in range(_RUNS // _PROCESSES):
                values = child.call("run", plan, _STEPS_OF_RUN)
                first = values if first is None else first
                same += values.tobytes() == first.tobytes()
                largest = max(largest, _deviation(subject, values, first))
    assert first is not None
    words = f"{same} of {_RUNS} runs of {subject.words} in {_PROCESSES} processes, with {first.size} numbers each, "
    words += "have the bits of the first one."
    if same < _RUNS:
        words += f" The others deviate by up to {in_short(largest)}."
    return Evidence(holds_if(same == _RUNS), words, f"{same} of {_RUNS}")


def step_cost(subject: Subject) -> Evidence:
    """Measure how long a communication step takes."""
    if subject.obstacle:
        return does_not_apply(subject.obstacle)
    plan = subject.plan
    piece = plan.length / len(plan.pieces)
    steps = max(1, round(piece / subject.step))
    h = piece / steps
    with subject.runs() as child:
        seconds = np.array(child.call("durations", plan, steps, _COST_SECONDS))
    low, median, high = np.quantile(seconds, (0.05, 0.5, 0.95)).tolist()
    words = f"The median of {len(seconds):,} communication steps of {h:.3g} s is {_time(median)}; 90 % take "
    words += f"{_time(low)} to {_time(high)}, with the call from Python. "
    words += f"That is {float(f'{h / median:.2g}'):,.6g} times as fast as real time."
    bins = np.linspace(0.0, 2.0 * median, 41)
    shares = np.histogram(np.minimum(seconds, bins[-1]), bins)[0] / len(seconds)
    return Evidence("measured", words, _time(median), curve={"edges": (1e6 * bins).tolist(), "shares": shares.tolist()})


def _time(seconds: float) -> str:
    factor, unit = next((pair for pair in ((1e6, "µs"), (1e3, "ms")) if seconds * pair[0] < 1e3), (1.0, "s"))
    return f"{factor * seconds:.3g} {unit}"


# ---- Limits ----------------------------------------------------------------------------------------------------------


def limits(subject: Subject) -> Evidence:
    """Ask for what is impossible, and see how the FMU answers."""
    if subject.obstacle:
        return does_not_apply(subject.obstacle)
    answers = [(what, _asked(subject, *call)) for what, call in _impossible(subject)]
    accepted = [what for what, answer in answers if answer.refused < answer.tried]
    changed = [what for what, answer in answers if answer.kept < answer.refused]
    share = f"{len(answers) - len(accepted)} of {len(answers)}"
    is_free = bool(accepted) and not subject.is_ours
    words = f"{share} kinds of impossible values and steps are refused"
    words += f". Not refused: {listed(accepted)}." if accepted else "." if changed else ", and the old values stay."
    if changed:
        words += f" A refusal changes something: {listed(changed)}."
    if is_free:
        words += " FMI leaves that to the FMU, so it is told, and is no failure."
    rows = [(capitalized(what), f"{a.refused} of {a.tried}", a.words) for what, a in answers]
    return Evidence(
        "measured" if is_free and not changed else holds_if(not (accepted or changed)),
        words,
        share,
        ("Asked for", "Refused", "Answer"),
        rows,
    )


def _impossible(subject: Subject) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Yield what is impossible in words, with the method of Runs and its argument."""
    inputs, parameters = (
        [v for v in subject.variables.values() if (v.causality, v.kind) == (causality, "Real")]
        for causality in ("input", "parameter")
    )
    beyond = {v.name: value for v in parameters if (value := _beyond(v.minimum, v.maximum)) is not None}
    for what, values in {
        "an input that is not a number": {v.name: nan for v in inputs},
        "an infinite input": {v.name: inf for v in inputs},
        "a parameter that is not a number": {v.name: nan for v in parameters},
        "a parameter beyond its bounds": beyond,
    }.items():
        if values:
            yield what, ("values_tried", [*values.items()])
    h = subject.step
    for what, length in {
        "a step of 0 s": 0.0,
        f"a step of −{h:g} s": -h,
        "a step past the stop time": 2.0 * subject.plan.length,
        "a step that is not a number": nan,
    }.items():
        yield what, ("step_tried", length)


def _asked(subject: Subject, method: str, argument: Any) -> Reaction:
    """Return the answer of the FMU. One that ends its process, or does not answer in time, has not refused."""
    try:
        with subject.runs(min(_WAIT, subject.time_limit)) as child:
            answer: Reaction = child.call(method, subject.plan, argument)
            return answer
    except (ChildError, RunError) as error:
        return Reaction(len(argument) if method == "values_tried" else 1, 0, 0, brief(f"it {error}", 160))


def _beyond(low: float, high: float) -> float | None:
    """Return a value below the least one of a variable, or above the largest one; None if it has no bounds."""
    if isfinite(low):
        return low - max(1.0, abs(low))
    return high + max(1.0, abs(high)) if isfinite(high) else None
