"""What is measured of an FMU, one function for each claim. A function returns the evidence."""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.fmu.card import read_card
from rov_fmu.fmu.claims.runs import REAL, Answer, Array, Plan, RunError
from rov_fmu.fmu.claims.subject import Subject
from rov_fmu.fmu.evidence.check import check_evidence
from rov_fmu.fmu.proof import SHARE_OF_NOMINAL, Finding, compare, nominal
from rov_fmu.io.child_process import ChildError
from rov_fmu.io.messages import brief, listed
from rov_fmu.vehicle.description import VERDICT

Result = Literal["holds", "fails", "measured", "not checked", "does not apply"]
"""`measured` is a fact without a promise: what a step costs, or what an FMU accepts that promised nothing."""
_STEPS = (2, 5, 10, 50)
"""The numbers of communication steps in each piece of a simulation that are compared with one step."""
_RUNS, _PROCESSES, _STEPS_OF_RUN = 100, 2, 10
_COST_SECONDS, _COST_STEPS = 1.0, 100
_WAIT = 5.0
"""The longest time for an answer to something impossible, s."""
_GLIDE, _GLIDE_STEPS = 10.0, 100
"""The length of a motion without thrust (s), and its number of steps."""
_DRAG, _LOAD = re.compile(r"[a-z]_d_\w+"), re.compile(r"F_0_\w+|[WB]|[XYZKMN]_[uvwpqr]{2}")
"""The parameters of drag, and those of constant loads, weight, buoyancy and lift."""
_LOSS = 1e-12
"""The increase of an energy, relative to the energy, that is a rounding error."""


_UNSEEN = re.compile("(?m)^Unseen data: (.*)")
"""A paragraph of the model card about a prediction."""


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


def _not(reason: str) -> Evidence:
    return Evidence("does not apply", f"{reason[:1].upper()}{reason[1:]}.")


def _tiny(value: float) -> str:
    """Return a relative deviation with two digits, or 0."""
    return f"{value:.1e}" if value else "0"


def _is(holds: bool) -> Result:
    return "holds" if holds else "fails"


# ---- Experiments -----------------------------------------------------------------------------------------------------

_SECOND_SOLVER = (
    " They come from a second solver of the same equation: an explicit Runge-Kutta method of order 8 (DOP853) in "
    "Python, run when the FMU was built, and not the Taylor series in C that the FMU runs. So they test the "
    "integration and the compiled code, and not the physics."
)


def expected(subject: Subject) -> Evidence:
    """Compare the FMU with the results that it carries."""
    if not subject.experiments:
        return _not("the FMU carries no expected results (FMI-LS-REF)")
    findings = compare(subject)
    by_experiment: dict[str, list[Finding]] = {}
    for f in findings:
        by_experiment.setdefault(f.experiment, []).append(f)
    worst = [max(own, key=lambda f: f.deviation / f.tolerance) for own in by_experiment.values()]
    wrong = [f for f in findings if not f.passed]
    tolerances, deviations = [f.tolerance for f in worst], [f.deviation for f in worst]
    words = f"{len(findings) - len(wrong)} of {len(findings)} results of {len(worst)} experiments are as expected"
    words += f", within {max(tolerances):.0e} of the largest value of each variable."
    words += _SECOND_SOLVER * (subject.is_ours and Path(subject.folder, "sources", "step.c").exists())
    if wrong:
        f = wrong[0]
        words += f" Experiment {f.experiment}: {f.error or f'{f.variable} deviates by {_tiny(f.deviation)}'}."
    rows = [(f.experiment, f.error or f.variable, _tiny(f.deviation), f"{f.tolerance:.0e}") for f in worst]
    return Evidence(
        _is(not wrong),
        words,
        _tiny(max(deviations)),
        ("Experiment", "Worst variable", "Deviation", "Tolerance"),
        rows if len(rows) <= 12 or wrong else (),
        {"deviations": deviations, "tolerance": tolerances},
    )


# ---- Runs ------------------------------------------------------------------------------------------------------------


def step_size(subject: Subject) -> Evidence:
    """Compare several communication steps with one, while the inputs are held."""
    if subject.obstacle:
        return _not(subject.obstacle)
    if not subject.description.coSimulation.canHandleVariableCommunicationStepSize:
        return _not("the FMU says that it needs communication steps of one size")
    plan, refused = subject.plan, ""
    ends: dict[int, Array] = {}
    with subject.runs() as child:
        for steps in (1, *_STEPS):
            try:
                ends[steps] = child.call("run", plan, steps)[steps::steps]
            except RunError as error:
                refused = f" It refuses {steps} in each piece: {error}."
    if len(ends) < 2:
        return _not(f"the FMU cannot be run with communication steps of several sizes.{refused.rstrip('.')}")
    (least, first), *others = ends.items()
    off = {steps: _deviation(subject, values, first) for steps, values in others}
    largest, allowed = max(off.values()), subject.allowed
    pieces = f"each of the {len(plan.pieces)} pieces with held inputs" if len(plan.pieces) > 1 else "the run"
    begin = "one step" if least == 1 else f"{least} steps"
    words = f"{subject.words}: {listed(map(str, off))} communication steps in {pieces} end where {begin} ends, "
    words += f"within {_tiny(largest)} of the largest value; {allowed:.0e} is allowed.{refused}"
    curve: dict[str, Sequence[float]] = {"steps": [*off], "deviations": [*off.values()], "allowed": [allowed]}
    return Evidence(_is(largest <= allowed), words[:1].upper() + words[1:], _tiny(largest), curve=curve)


def _deviation(subject: Subject, values: Array, reference: Array) -> float:
    """Return the largest deviation, relative to the largest value of a variable or to 1 % of its nominal value."""
    least = [SHARE_OF_NOMINAL * nominal(subject.variables[name]) for name in subject.plan.outputs]
    scale = np.maximum(np.abs(reference).max(axis=0), least)
    same = (values == reference) | (np.isnan(values) & np.isnan(reference))
    off = float(np.where(same, 0.0, np.abs(values - reference) / scale).max())
    return off if isfinite(off) else inf


def repeatability(subject: Subject) -> Evidence:
    """Repeat a run in new instances of several processes, and compare the bytes of all results."""
    if subject.obstacle:
        return _not(subject.obstacle)
    plan = subject.plan
    counts: dict[str, int] = {}
    first = None
    largest = 0.0
    for _ in range(_PROCESSES):
        with subject.runs() as child:
            for _ in range(_RUNS // _PROCESSES):
                values = child.call("run", plan, _STEPS_OF_RUN)
                first = values if first is None else first
                digest = hashlib.sha256(values.tobytes()).hexdigest()
                counts[digest] = counts.get(digest, 0) + 1
                largest = max(largest, _deviation(subject, values, first))
    assert first is not None
    same = next(iter(counts.values()))
    words = f"{same} of {_RUNS} runs of {subject.words} in {_PROCESSES} processes, with {first.size} numbers each, "
    words += "have the bits of the first one."
    if len(counts) > 1:
        words += f" The others deviate by up to {_tiny(largest)}."
    return Evidence(_is(len(counts) == 1), words, f"{same} of {_RUNS}")


def cost(subject: Subject) -> Evidence:
    """Measure how long a communication step takes."""
    if subject.obstacle:
        return _not(subject.obstacle)
    plan = subject.plan
    piece = (plan.stop - plan.start) / len(plan.pieces)
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


# ---- Laws of conservation --------------------------------------------------------------------------------------------


def conservation(subject: Subject) -> Evidence:
    """Let a vehicle glide without thrust and drag, and then with drag."""
    if subject.obstacle:
        return _not(subject.obstacle)
    has = subject.variables
    axes = [axis for axis in AXES.values() if {axis.velocity, axis.external, f"der({axis.velocity})"} <= has.keys()]
    if not axes or not subject.is_ours:
        return _not("it is known only of vehicles of rov-fmu which parameters switch drag and loads off")
    loads, drag = (dict.fromkeys(filter(kind.fullmatch, has), "0") for kind in (_LOAD, _DRAG))
    if fixed := [name for name in loads | drag if has[name].causality != "parameter"]:
        return _not(f"{listed(fixed)} cannot be set to 0")
    free, braked = _energies(subject, axes, loads | drag, loads)
    drift = float(np.abs(free / free[0] - 1.0).max())
    gain = float(np.max(np.diff(braked) / braked[0], initial=-inf))
    allowed = subject.allowed
    words = f"Without thrust, drag and constant loads, the kinetic energy stays the same for {_GLIDE:g} s within "
    words += f"{_tiny(drift)}; {allowed:.0e} is allowed. With its own drag it falls from {braked[0]:.3g} J to "
    words += f"{braked[-1]:.2g} J{' and never rises' if gain <= _LOSS else f', but rises by {_tiny(gain)} in a step'}."
    return Evidence(_is(drift <= allowed and gain <= _LOSS), words, _tiny(drift))


def _energies(
    subject: Subject, axes: Sequence[Axis], free: Mapping[str, str], braked: Mapping[str, str]
) -> list[Array]:
    """Return the kinetic energy v' M v / 2 during a glide with parameters that switch drag off, and with others.

    M is measured: its inverse has the accelerations that loads of 1 N or 1 N m give at rest.
    """
    inputs = {v.name: float(v.start or 0.0) for v in subject.variables.values() if v.causality == "input"}
    velocities = [axis.velocity for axis in axes]
    rates = [f"der({name})" for name in velocities]
    begin = {name: f"{0.5 + 0.1 * n:g}" for n, name in enumerate(velocities)}
    with subject.runs() as child:

        def accelerations(**load: float) -> Any:
            return child.call("run", Plan(0.0, ((1e-3, inputs | load),), free, rates), 1)[0]

        still = accelerations()
        mass = np.linalg.inv(np.column_stack([accelerations(**{axis.external: 1.0}) - still for axis in axes]))
        glides = [
            child.call("run", Plan(0.0, ((_GLIDE, inputs),), {**parameters, **begin}, velocities), _GLIDE_STEPS)
            for parameters in (free, braked)
        ]
    return [0.5 * np.einsum("ti,ij,tj->t", v, mass, v) for v in glides]


# ---- Limits ----------------------------------------------------------------------------------------------------------


def limits(subject: Subject) -> Evidence:
    """Ask for what is impossible, and see how the FMU answers."""
    if subject.obstacle:
        return _not(subject.obstacle)
    answers = [(what, _asked(subject, *call)) for what, call in _impossible(subject)]
    accepted = [what for what, answer in answers if answer.refused < answer.tried]
    changed = [what for what, answer in answers if answer.kept < answer.refused]
    share = f"{len(answers) - len(accepted)} of {len(answers)}"
    is_free = bool(accepted) and not subject.is_ours
    words = f"{share} kinds of impossible values and steps are refused{_exceptions(accepted, changed)}"
    if is_free:
        words += " FMI leaves that to the FMU, so it is told, and is no failure."
    rows = [(f"{what[:1].upper()}{what[1:]}", f"{a.refused} of {a.tried}", a.words) for what, a in answers]
    result: Result = "measured" if is_free and not changed else _is(not (accepted or changed))
    return Evidence(result, words, share, ("Asked for", "Refused", "Answer"), rows)


def _exceptions(accepted: list[str], changed: list[str]) -> str:
    """Return the end of the sentence about refusals: what is not refused, and what changes something."""
    if not (accepted or changed):
        return ", and the old values stay."
    words = f". Not refused: {listed(accepted)}." if accepted else "."
    return words + (f" A refusal changes something: {listed(changed)}." if changed else "")


def _impossible(subject: Subject) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Yield what is impossible in words, with the method of Runs and its argument."""
    inputs, parameters = (subject.numbers(causality, REAL) for causality in ("input", "parameter"))
    beyond = {name: value for name in parameters if (value := _beyond(*subject.bounds[name])) is not None}
    for what, values in {
        "an input that is not a number": dict.fromkeys(inputs, nan),
        "an infinite input": dict.fromkeys(inputs, inf),
        "a parameter that is not a number": dict.fromkeys(parameters, nan),
        "a parameter beyond its bounds": beyond,
    }.items():
        if values:
            yield what, ("values_tried", [*values.items()])
    h = subject.step
    for what, length in {
        "a step of 0 s": 0.0,
        f"a step of −{h:g} s": -h,
        "a step past the stop time": 2.0 * (subject.plan.stop - subject.plan.start),
        "a step that is not a number": nan,
    }.items():
        yield what, ("step_tried", length)


def _asked(subject: Subject, method: str, argument: Any) -> Answer:
    """Return the answer of the FMU. One that ends its process, or does not answer in time, has not refused."""
    try:
        with subject.runs(min(_WAIT, subject.time_limit)) as child:
            answer: Answer = child.call(method, subject.plan, argument)
            return answer
    except (ChildError, RunError) as error:
        return Answer(len(argument) if method == "values_tried" else 1, 0, 0, brief(f"it {error}", 160))


def _beyond(low: float, high: float) -> float | None:
    """Return a value below the least one of a variable, or above the largest one; None if it has no bounds."""
    if isfinite(low):
        return low - max(1.0, abs(low))
    return high + max(1.0, abs(high)) if isfinite(high) else None


# ---- What the FMU says about itself ----------------------------------------------------------------------------------


def integrity(subject: Subject) -> Evidence:
    """Check the hashes in the FMU and the signature beside it. Raises ProofError if one of them does not fit."""
    evidence = check_evidence(subject.path, subject.key)
    if not (evidence.files or evidence.signer):
        return _not("the FMU carries no hashes of its files, and no signature lies beside it")
    count = len(evidence.files)
    if evidence.signer:
        known = "given with --key" if subject.key else "compare it with the fingerprint that its maker gives"
        words = f"All {count} files are as they were built; it is signed with the key {evidence.signer} ({known})."
    else:
        words = f"All {count} files match the hashes in the FMU. It is not signed: whoever changed a file may have "
        words += "changed its hash too."
    rows = [("Program", name, digest) for name, digest in evidence.generator.items()]
    rows += [("File read", name, digest) for name, digest in evidence.inputs.items()]
    return Evidence("holds", words, f"{count} files", ("Made from", "Name", "Hash"), rows)


def unseen(subject: Subject) -> Evidence:
    """Repeat what the model card says about predictions of motion that the identification had not seen.

    An axis whose verdict is *do not use* makes no promise, so that the claim does not fail: the FMU is as it was built,
    and says so itself. The evidence names the axis, with the reasons, and does not count as held.
    """
    paragraphs = card_of(subject).get("How far to trust it", [])
    errors = _UNSEEN.findall("\n".join(paragraphs))
    verdicts = [found.groups() for found in map(VERDICT.fullmatch, paragraphs) if found]
    if not (errors or verdicts):
        return Evidence("not checked", paragraphs[0] if paragraphs else "The FMU says nothing about unseen data.")
    bad = {axis: reasons for axis, word, reasons in verdicts if word == "do not use"}
    words = f"The model card has the errors of {len(errors)} predictions."
    figure = f"do not use {listed(bad)}" if bad else ""
    if verdicts:
        words += f" Its verdicts: {'; '.join(f'{axis}: {word}' for axis, word, _ in verdicts)}."
        identified = sum(word != "not identified" for _, word, _ in verdicts)
        figure = figure or f"{identified} of {len(verdicts)} axes"
    words += "".join(f" Do not use {axis}: {reasons}" for axis, reasons in bad.items())
    rows = [tuple(one.rstrip(".").split(": ", 1)) for one in errors]
    return Evidence("holds" if verdicts and not bad else "measured", words, figure, ("Quantity", "Error"), rows)


def card_of(subject: Subject) -> dict[str, list[str]]:
    """Return the model card of an FMU of ours, by its headings; an empty one if there is none."""
    path = Path(subject.folder, "documentation", "model_card.txt")
    return read_card(path.read_text(encoding="utf-8", errors="replace")) if path.is_file() else {}
