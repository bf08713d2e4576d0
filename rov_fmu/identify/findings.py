"""The sentences about an identification, by kind of finding."""

from collections.abc import Callable, Iterable, Mapping
from math import log, pi
from pathlib import Path
from typing import Any

from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.io.csv_table import FORCE_UNITS
from rov_fmu.tank import findings
from rov_fmu.tank.findings import Finding, SentenceForm
from rov_fmu.vehicle.uncertainty import in_interval


def sentences(found: Iterable[Finding]) -> tuple[str, ...]:
    """Return the sentences of findings; similar findings share one sentence."""
    return findings.sentences(found, _SENTENCES)


def warnings(found: Iterable[Finding]) -> tuple[str, ...]:
    """Return the sentences of warnings and doubts."""
    return sentences(finding for finding in found if finding.kind not in FACTS)


def facts(found: Iterable[Finding]) -> tuple[str, ...]:
    """Return the sentences of the findings that only say what was found or done."""
    return sentences(finding for finding in found if finding.kind in FACTS)


def refusals(found: Iterable[Finding], folder: Path) -> list[str]:
    """Return a sentence for each finding, with the whole path of its file."""
    return findings.refusals(found, folder, _SENTENCES)


def _inseparable_drag(values: Mapping[str, Any]) -> str:
    """List the coefficients of drag that are not identifiable, or whose intervals are wide."""
    coefficients = []
    for key in ("a_d", "b_d"):
        if key in values:
            reason = "is not identifiable at all"
            if f"{key} low" in values:
                around = values[f"{key} low"].low, values[f"{key} high"].high
                reason = "may lie anywhere from {} to {}".format(*in_interval(around, around)[2:])
            coefficients.append(f"{values[key]} {reason}")
    together = f" (correlation {values['correlation']:.2f})" if "correlation" in values else ""
    return (
        f"{values['axes']}: the tests hardly separate quadratic from linear drag: {', '.join(coefficients)}"
        f"{together}. Only their sum at the tested velocities is identifiable"
    )


def _drag_at_zero(values: Mapping[str, Any]) -> str:
    unbounded = f" (by (11)-(13) alone {values['unbounded']:.3g})" if "unbounded" in values else ""
    return (
        f"{values['axes']}: {values['coefficient']} is at its bound of 0. Without the bound the fit would be "
        f"negative{unbounded}, which is impossible"
    )


def _asymmetry(values: Mapping[str, Any]) -> str:
    whose = f"{values['curve']} thrust" if values["curve"] else values["axes"]
    by_model = (
        f"In the model it differs by {values['modelled']:+.0%}"
        if "modelled" in values
        else "The model has no such difference"
    )
    return (
        f"{whose}: at {values['command']:.0%}, {values['quantity']} in reverse differs by {values['measured']:+.0%} "
        f"from that ahead. {by_model}. To leave out one direction, set {values['window']} in [windows]"
    )


def _disagreement(values: Mapping[str, Any]) -> str:
    low, high = f"{values['low']:.2g}", f"{values['high']:.2g}"
    factors = low if low == high else f"{low} to {high}"
    return (
        f"{values['axes']}: the recordings disagree on {values['coefficients']} by more than their residuals explain, "
        f"so the model lacks something. The intervals are made {factors} times as wide"
    )


def _effect(form: str, form_of_file: str = "") -> Callable[[Mapping[str, Any]], str]:
    """Return a form that has {value}, {interval}, which may be empty, and {of}: an axis, a curve or the files.

    `form_of_file` replaces the form for a single recording. The digits suit the interval. Several findings share the
    range of their values and one interval around all.
    """

    def sentence(values: Mapping[str, Any]) -> str:
        value, interval = values["value"], ""
        ends = [f"{value.low:.4g}", f"{value.high:.4g}"]
        if "low" in values:
            *ends, low, high = in_interval((value.low, value.high), (values["low"].low, values["high"].high))
            interval = f" ({low} to {high})"
        written = {"value": " ... ".join(dict.fromkeys(ends)), "interval": interval}
        chosen = form if "of" in values else form_of_file or form
        return chosen.format(**{"of": values["files"], **values, **written})

    return sentence


_LENGTH_CAUSES = {
    1000.0: "is it in mm",
    100.0: "is it in cm",
    10.0: "is it in dm, or is the scale of the sensor wrong",
    0.1: "is the unit or the scale of the sensor wrong",
    0.01: "are metres labelled as cm",
    0.001: "are metres labelled as mm",
}
_ANGLE_CAUSES = {
    pi / 180.0: "are radians labelled as degrees",
    180.0 / pi: "are degrees labelled as radians",
    10.0: "is it in tenths of a degree, or is the scale of the sensor wrong",
    100.0: "is it in hundredths of a degree",
    0.1: "is the unit or the scale of the sensor wrong",
}


def _wrong_scale(values: Mapping[str, Any]) -> str:
    """Explain that the numbers of a file are a multiple of what was measured."""
    factor = float(values["factor"])
    causes = _ANGLE_CAUSES if values["unit"].startswith("rad") else _LENGTH_CAUSES
    others = f" If not, check {values['others']}." if values["others"] else ""
    if values["unit"].startswith("rad"):
        others += " Also check the positions and directions of the thrusters in rov.toml."
    return (
        f"{values['files']}: {values['quantity']} is about {factor:.4g} times what the thrust, the size and the other "
        f"files predict: {causes[factor]}?{others}"
    )


_USUAL_BETA = 0.65
"""β of an ROV whose added mass is about half of its mass."""


def _weak_thrust(values: Mapping[str, Any]) -> str:
    """Explain that all axes of a curve move as if the thrust were several times as strong.

    The factor is the geometric mean of β. If the forces were larger by this factor, β would be 1. The true factor is
    larger, because β of an ROV is below 1. The likely cause is the one that leads to the most usual β.
    """
    factor = float(values["factor"])
    causes = {1.0 / of_newton: f"are they in {unit}" for unit, of_newton in FORCE_UNITS.items() if unit != "N"}
    if values["together"] != "1":
        causes[float(values["together"])] = f"are they of one thruster, and not of all {values['together']} together"
    cause = causes[min(causes, key=lambda other: abs(log(_USUAL_BETA * other / factor)))]
    return (
        f"{values['curve']} thrust: {values['axes']} move as if the forces of thrust_{values['curve']}*.csv were at "
        f"least {factor:.2g} times as strong: {cause}?"
    )


_CAUSES = {
    "voltage": (
        "the residuals grow when the voltage changes. A thrust that depends on the voltage would explain "
        "this: put `voltage = true` into [fit]"
    ),
    "pitch": "the residuals follow the pitch. If pitch and roll are logged, `attitude = true` in [fit] takes "
    "them into account. Otherwise the vehicle needs the axis pitch",
    "roll": "the residuals follow the roll. If pitch and roll are logged, `attitude = true` in [fit] takes "
    "them into account. Otherwise the vehicle needs the axis roll",
    "depth": "the residuals follow the depth, as when the buoyancy changes with the pressure, or a tether pulls",
    "distance": "the residuals follow the logged distance, as when a tether pulls",
    "tether": "a force grows with the distance from the start, as when a tether pulls",
    "saturation": "the thrust differs from its curve at the highest commands, as when thrusters saturate",
    "drift": "the thrust or the load changes with time, as when the voltage falls",
    "recording": "thrust or drag differ between the recordings. Did the battery, the ballast, the tether or the place "
    "of a sensor change between them, or are columns of a log swapped or missing?",
    "odd one": "it explains all other recordings. Check the columns, units and signs of this log, and whether the "
    "battery, the ballast, the tether or a sensor differed",
    "scale": "the sensors of position and velocity disagree, so one of them has a wrong scale",
    "unknown": "an unknown force that changes slowly acts. None of the tested causes explains it",
}
"""What the residuals show, by cause (rov_fmu/identify/structure.py)."""


def _unexplained(values: Mapping[str, Any]) -> str:
    start = f"{values['start']:.0f}"
    when = "from the start" if start == "0" else f"after the first {start} s"
    return f"{values['axes']}: the model does not explain {values['files']} {when}: {_CAUSES[values['cause']]}"


_OUTLIERS = "{axes}: {share:.0%} of the samples of {files} are outliers and count less"
_OWN_SENTENCES: dict[str, SentenceForm] = {
    # Thrust curves
    "thrust without freedom": (
        "{curve} thrust: {count:g} points for two coefficients leave no degree of freedom, so there are no intervals"
    ),
    "backward thrust": (
        "{curve} thrust: below a command of {command:.0%}, the curve gives thrust in the wrong "
        "direction. A dead band would explain this: measure forces at weaker commands, or give "
        "c_0_{curve} in [known]"
    ),
    "backward thrust in reverse": (
        "{curve} thrust: below a command of {command:.0%} in reverse, the curve gives thrust in the wrong "
        "direction. A dead band would explain this: measure forces at weaker commands, or give "
        "c_0_{curve} in [known]"
    ),
    "asymmetry": _asymmetry,
    # Drag and beta from points
    "assumed beta": (
        "{axes}: {inertia}/{beta} is not identifiable from V_ss alone. {beta} = 1 is assumed, and every Tau follows "
        "from it. A time constant or a recording of a step from rest makes it identifiable"
    ),
    "no push": (
        "{axes}: the points at commands of {commands} are left out, because the thrust curve gives no "
        "thrust there (dead band, or a mistake in one of the tables)"
    ),
    "unknown voltage": (
        "{curves} thrust is taken as measured at {voltage:.1f} V, the mean voltage of the logs. If it was measured at "
        "another voltage, thrust, drag and β are wrong by a common factor: write the voltage into [known], such as "
        '{key} = {{ value = 16.0, unit = "V", source = "Multimeter" }}'
    ),
    "tests turn": (
        "{axes}: at a command of {command:.0%} its thrusters also turn the vehicle, at up to {rate:.0f} deg/s. The "
        "tables are taken as those of a vehicle that keeps its heading. If yours turned, record a log of commands, "
        "velocities and heading instead"
    ),
    "untested thrust": (
        "{axes}: commands of {low:.0%} to {high:.0%} are used, but {curve} thrust was tested from {tested_low:.0%} to "
        "{tested_high:.0%} only"
    ),
    "drag without freedom": (
        "{axes}: as many coefficients as measurements leave no degree of freedom, so there are no intervals"
    ),
    "inseparable drag": _inseparable_drag,
    "drag at zero": _drag_at_zero,
    "leave-one-out error": (
        "{axes}: the leave-one-thrust-out error of {quantity} is {predicted:.1%} (RMS), but the residual of the fit "
        "is only {fitted:.1%}. Single points determine much of the fit"
    ),
    "tables against recordings": (
        "{axes}: {quantity} of the tables differs by {error:.0%} (RMS) from that of the recordings. The vehicle has "
        "the coefficients of the recordings, because tables do not distinguish delay, load and current from drag"
    ),
    # Recordings
    "correlated residuals": (
        "{axes}: the residuals of {files} are correlated over {samples:.0f} samples. They contain more "
        "than the sensor's noise: turbulence, a tether, or an error of the model. The intervals allow "
        "for this"
    ),
    "outliers": _OUTLIERS,
    "many outliers": f"{_OUTLIERS}. Does the sensor jump, or did something hold or push the vehicle for a time?",
    "coupling left out": (
        "{files}: the vehicle turns while it moves in surge or sway, but the model leaves out the Coriolis and Munk "
        "forces of such a motion: `coupling = true` in [body] of rov.toml adds them"
    ),
    "disagreement": _disagreement,
    "impossible velocity": (
        "{files}: the recording of {axes} is left out: {quantity} gives a velocity of {speed:.3g} "
        "{unit}, but only {low:g} to {high:g} is possible. Are its unit and the unit of time right?"
    ),
    "no thrust": (
        "{axes}: all its tests are left out, because the thrust curve of {curves} gives {force:.3g} "
        "{unit} at a command of {command:.0%}, which does not push in the direction of the command. "
        "Check the thrust tests, their signs and windows"
    ),
    "no tests of drag": (
        "{axes}: all tests of it are left out, because no test that counts determines its drag, and "
        "rov.toml does not give {drag}"
    ),
    "no fit": "{files}: the recording of {axes} is left out, because {reason}. {cause}",
    "fitted apart": (
        "{axes}: no vehicle fits the recordings of all these axes together, so each axis is fitted alone: {reason}"
    ),
    "poor prediction": (
        "{axes}: do not trust this axis. A fit to {others} predicts the velocity of a recording with an error of "
        "{predicted:.2g} {unit} (RMS). The error of predicting no change is {unchanged:.2g} {unit}, and the sensor's "
        "noise is {noise:.1g} {unit}"
    ),
    "failed prediction": (
        "{axes}: the motion of {files} cannot be computed with a fit to the others, so its prediction is left out. "
        "Check its units and signs, and whether a thruster was saturated or a tether was taut"
    ),
    "recordings against forces": (
        "{axes}: the recordings need another {curve} thrust than the measured forces: {joint:.3g} N instead of "
        "{alone:.3g} N at a command of {command:.0%}. A thruster may push less in motion than when it is held, or the "
        "scale or the battery may differ. The vehicle has the curve that fits both best"
    ),
    # Effects
    "switches between rows": (
        "{axes}: the commands change between the rows of the logs. A change is taken to be midway between two rows, "
        "and the intervals allow for its unknown time"
    ),
    **{
        kind: _effect(*(f"{{axes}}: {form}" for form in (effect.sentence, effect.sentence_of_file) if form))
        for kind, effect in EFFECTS.items()
    },
    "delay not modelled": _effect(
        "The motion in {axes} followed the commands {value} s late{interval}. The vehicle file does not "
        "contain this delay. T_d in [commands] adds a delay to the FMU, which is the same for all axes."
    ),
    # Structure of the model
    "unexplained": _unexplained,
    "lag suggested": (
        "{axes}: the motion in {files} follows the commands with a lag that the model does not have: put the curve of "
        "its thrusters into `lag` of [fit]"
    ),
    # Units and signs
    "implausible beta": (
        "{axes}: {beta} = {value:.3g} is not within {low:g} ... {high:g}, the range of all known "
        "vehicles. The vehicle moves as if its inertia were {inertia}. A wrong unit or scale (of the "
        "motion, the commands, the thrust, {mass}) may cause it, a wrong position or direction of a "
        "thruster, or a delay or a lag that the fit does not have"
    ),
    "inertia below mass": _effect(
        "{axes}: {beta} = {value}{interval} is above 1, so the vehicle moves as if its inertia with the added mass "
        "were less than {mass} alone. Check {mass}, the positions and directions of the thrusters, and the measured "
        "forces"
    ),
    "implausible tuned alpha": (
        "{alpha} = {value:.3g} is not within the usual {low:g} ... {high:g}: the {push} would be {value:.3g} times "
        "that of the thrust curves, which tests give to better than a factor of 2. Check the wanted V_ss and its unit "
        "({unit}), the command, and the thrust curves"
    ),
    "implausible tuned beta": (
        "{beta} = {value:.3g} is not within the usual {low:g} ... {high:g}. The vehicle would move as if "
        "its inertia were {inertia}. No known vehicle does. Check the wanted Tau (s) and {mass}"
    ),
    "weak thrust": _weak_thrust,
    "wrong scale": _wrong_scale,
    "too fast": (
        "{files}: {quantity} [{unit}] gives a velocity of {speed:.3g} {speed_unit}, which no ROV "
        "reaches. Are its unit and the unit of time right?"
    ),
    "wrong sign": (
        "{files}: the vehicle moves against the command. Is the sign of {quantity} or of the commands "
        "wrong, or are thrusters swapped? {positive} is positive"
    ),
    "fractions as percent": (
        "{files}: no command exceeds {percent:.2g} % of the full command, which is too weak to move an "
        "ROV: are fractions [1] labelled as percent [%]?"
    ),
    "slow time constants": (
        "{files}: time constant [s] is {ratio:.2g} times that of a vehicle that fits the other data: is it in ms?"
    ),
    "fast time constants": (
        "{files}: time constant [s] is {ratio:.2g} times that of a vehicle that fits the other data: are seconds "
        "labelled as ms?"
    ),
}
_SENTENCES = findings.SENTENCES | _OWN_SENTENCES

# ---- Facts, doubts and warnings --------------------------------------------------------------------------------------

FACTS = frozenset(EFFECTS) | {
    "rows sorted",
    "time stamps merged",
    "rows without time",
    "rows without command",
    "torn rows",
    "unread cells",
    "no pulse",
    "no servo pulse",
    "beyond full thrust",
    "constant motion",
    "constant push",
    "cancelling thrusters",
    "gaps",
    "source of commands",
    "source",
    "range of pulses",
    "dropouts",
    "damaged pieces",
    "reversed motors",
    "axis left out",
    "not coupled",
    "unused curve",
    "outliers",
    "switches between rows",
    "delay not modelled",
}
"""The kinds of findings that need no action."""
FIRST = frozenset(
    {"unreadable file", "missing column", "copy", "frozen sensors", "axis not pushed", "no fit", "poor prediction"}
)
"""The kinds of warnings that stand first: wrong or missing data, and axes that must not be trusted."""
DOUBTS = frozenset(
    {
        "too few samples",
        "time of arrival",
        "other clock",
        "aligned clock",
        "unknown direction",
        "unknown velocity",
        "depth by pressure",
        "thrust without freedom",
        "drag without freedom",
        "assumed beta",
        "untested thrust",
        "inseparable drag",
        "drag at zero",
        "leave-one-out error",
        "correlated residuals",
    }
)
"""The kinds of findings about open questions. Kinds in neither set are warnings."""


def heading(finding: Finding) -> str:
    """Return the heading that a finding belongs to."""
    return "Facts" if finding.kind in FACTS else "Doubts" if finding.kind in DOUBTS else "Warnings"


def by_heading(found: Iterable[Finding]) -> dict[str, tuple[str, ...]]:
    """Return the sentences of findings by their headings."""
    groups: dict[str, list[Finding]] = {name: [] for name in ("Warnings", "Doubts", "Facts")}
    for finding in found:
        groups[heading(finding)].append(finding)
    return {name: sentences(some) for name, some in groups.items()}
