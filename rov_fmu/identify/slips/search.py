"""Slips of a hand or a script in recordings: a unit, a scale, a sign, each with its file and likely cause.

Every recording is looked at by itself first (rov_fmu/identify/slips/single_recording.py), then all of an axis together
(rov_fmu/identify/slips/explanation.py). Where there is no doubt a recording is refused; else there is a warning.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isclose, isfinite, nan, pi

import numpy as np
from scipy.optimize import nnls

from rov_fmu.identify.recordings.runs import prepare
from rov_fmu.identify.slips.explanation import CERTAIN, FASTEST, LIKELY, Evidence, Explanation, Files, contradict
from rov_fmu.identify.slips.single_recording import Alone, alone
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.recording import Recording

Tables = Mapping[str, Sequence[tuple[float, float]]]
"""Rows by file: command and a number."""
BETA = 0.05, 1.2
"""Without added mass: m/β is between about the mass alone and 20 times of it."""
BETA_WITH_ADDED_MASS = 0.3, 3.0
_FRACTIONS = 0.01  # commands within are fractions of a percent, or fractions taken for percent

_FAR, _VERY_FAR = 20.0, 100.0  # from a time constant
_UNIT = "fits thrust, size and other files only"
_TOO_FAST = "which no ROV reaches: is its unit right, and that of time?"

_LENGTH_CAUSES = {
    1000.0: "is it in mm",
    100.0: "is it in cm",
    10.0: "is it in dm, or the scale of the sensor wrong",
    0.1: "is the unit or the scale of the sensor wrong",
    0.01: "are metres taken for cm",
    0.001: "are metres taken for mm",
}
_ANGLE_CAUSES = {
    pi / 180.0: "are radians taken for degrees",
    180.0 / pi: "are degrees taken for radians",
    10.0: "is it in tenths of a degree, or the scale of the sensor wrong",
    100.0: "is it in hundredths of a degree",
    0.1: "is the unit or the scale of the sensor wrong",
}


@dataclass(frozen=True)
class Finding:
    """Something wrong with a recording or a table."""

    file: str
    words: str
    certain: bool
    """Whether to refuse it."""

    @property
    def sentence(self) -> str:
        """With its file."""
        return f"{self.file}: {self.words}"


def slips(
    recordings: Mapping[str, Sequence[Recording]],
    base: Rov,
    known: Collection[str] = (),
    steady: Mapping[str, Tables] | None = None,
    time_constants: Mapping[str, Tables] | None = None,
) -> tuple[Finding, ...]:
    """What is wrong with the recordings, by axis name; `base` holds thrust and inertia, and what else is known.

    The tables have commands and velocities (m/s, rad/s), commands and time constants (s), by axis name.
    """
    found: list[Finding] = []
    for axis in (form.axis for form in base.layout.axes):
        name, evidence = axis.name, list[Evidence]()
        found += _of_recordings(axis, recordings.get(name, ()), base, evidence)
        tables = [e for file, rows in (steady or {}).get(name, {}).items() if (e := _table(axis, base, file, rows))]
        found += [
            Finding(e.file, _too_fast(e.quantity, axis, e.alone.speed), certain=True)
            for e in tables
            if e.alone.speed > FASTEST[axis.unit]
        ]
        evidence += tables
        vehicle = _given(axis, base, known)
        if evidence:
            explanations = Files(axis, base, evidence, vehicle).explanations()
            vehicle = explanations[0].vehicle
            found += _units(axis, evidence, explanations)
        if vehicle:
            for file, rows in (time_constants or {}).get(name, {}).items():
                found += _slow(axis, base, vehicle, file, rows)
    refused = {finding.file for finding in found if finding.certain and _UNIT in finding.words}
    return tuple(f for f in found if not (f.words.endswith(_TOO_FAST) and f.file in refused))


def beta_range(rov: Rov, axis: Axis) -> tuple[float, float, str]:
    """The least and the greatest β of vehicles that are known, and in words the inertia that this vehicle's β means."""
    beta, has_added = axis.coefficient("beta"), "m_a" in rov.layout.kinds[axis.name].keys
    inertia = f"{1.0 / max(rov[beta], 1e-9):.3g} times {axis.inertia}{' and the added one' if has_added else ''}"
    return (*(BETA_WITH_ADDED_MASS if has_added else BETA), inertia)


def beta_out_of_range(rov: Rov, axis: Axis) -> str | None:
    """Of the final fit: what may cause a β that no vehicle has."""
    beta, (low, high, inertia) = axis.coefficient("beta"), beta_range(rov, axis)
    if low <= rov[beta] <= high:
        return None
    return (
        f"{axis.name}: {beta} = {rov[beta]:.3g} is not within {low:g} ... {high:g}, as of any vehicle known: it moves "
        f"as if its inertia were {inertia}. A wrong unit or scale (of the motion, the commands, the thrust, "
        f"{axis.inertia}) may cause it, or a delay or a lag that the fit does not have"
    )


def _of_recordings(
    axis: Axis, recordings: Sequence[Recording], base: Rov, evidence: list[Evidence]
) -> Iterator[Finding]:
    """What is wrong with single ones; what they tell goes to the evidence."""
    for recording in recordings:
        data = prepare(recording, base)
        strongest = float(np.abs(data.commands).max(initial=0.0))
        if 0.0 < strongest <= _FRACTIONS:
            yield Finding(recording.file, _fractions(strongest), certain=True)
            continue
        if data.speed > FASTEST[axis.unit]:
            yield Finding(recording.file, _too_fast(recording.quantity, axis, data.speed), certain=True)
        if (found := alone(data, base)) is not None:
            evidence.append(Evidence(recording.file, recording.quantity, found))
            if found.turned:
                yield Finding(recording.file, _turned(recording), found.is_clear)


def _units(axis: Axis, evidence: Sequence[Evidence], explanations: Sequence[Explanation]) -> Iterator[Finding]:
    best = explanations[0]
    gained = next(e.cost for e in explanations if not e.files) - best.cost
    if not best.files or gained < LIKELY:
        return
    other = contradict(explanations)
    for one in evidence:
        if one.file in best.files:
            words = _scale(one, axis, best)
            if other:
                words += f" Or else are those wrong that it contradicts: {', '.join(sorted(other.files))}?"
            yield Finding(one.file, words, gained >= CERTAIN and one.alone.is_clear)


def _slow(axis: Axis, base: Rov, vehicle: Alone, file: str, rows: Sequence[tuple[float, float]]) -> Iterator[Finding]:
    """Time constants far from those of the vehicle; where its inertia is not told, of one with a typical inertia."""
    inertia = vehicle.inertia if isfinite(vehicle.inertia) else 2.0 * base.inertia(base.layout.kinds[axis.name])
    alpha = base[axis.coefficient("alpha")]
    ratios = [
        Tau * abs(alpha * base.force(axis, c)) / inertia / vehicle.steady(abs(alpha * base.force(axis, c)))
        for c, Tau in rows
        if base.force(axis, c)
    ]
    ratio = float(np.median(ratios)) if ratios else 1.0
    if not 1.0 / _FAR < ratio < _FAR:
        cause = "is it in ms" if ratio > 1.0 else "are seconds taken for ms"
        words = f"time constant [s] is {ratio:.2g} times that of a vehicle that fits the other data: {cause}?"
        yield Finding(file, words, not 1.0 / _VERY_FAR < ratio < _VERY_FAR)


def _scale(one: Evidence, axis: Axis, best: Explanation) -> str:
    causes = _ANGLE_CAUSES if axis.position_unit == "rad" else _LENGTH_CAUSES
    cause = next(words for factor, words in causes.items() if isclose(factor, best.factor))
    times = f"x {1.0 / best.factor:.4g}" if best.factor < 1.0 else f"/ {best.factor:.4g}"
    return f"{_named(one.quantity, axis)} {_UNIT} {times}: {cause}?"


def _named(quantity: str, axis: Axis) -> str:
    return f"{quantity} [{axis.position_unit if quantity != 'velocity' else axis.unit}]"


def _too_fast(quantity: str, axis: Axis, speed: float) -> str:
    return f"{_named(quantity, axis)} tells of {speed:.3g} {axis.unit}, {_TOO_FAST}"


def _turned(recording: Recording) -> str:
    axis = recording.axis
    return (
        f"moves against the command: is the sign of {recording.quantity} or of the commands turned? "
        f"{axis.positive.capitalize()} is +"
    )


def _fractions(strongest: float) -> str:
    return (
        f"no command is beyond {100.0 * strongest:.2g} % of full thrust, which moves no ROV: "
        "are fractions [1] taken for percent [%]?"
    )


def _given(axis: Axis, base: Rov, known: Collection[str]) -> Alone | None:
    """The vehicle, where all of drag and β is known."""
    form = base.layout.kinds[axis.name]
    names = [axis.coefficient("beta"), form.coefficient("a_d"), form.coefficient("b_d")]
    if not set(names) <= set(known):
        return None
    return Alone(False, base.effective_inertia(form), base[names[1]], base[names[2]], 1.0, (0.0, 0.0), 1.0)


def _table(axis: Axis, base: Rov, file: str, rows: Sequence[tuple[float, float]]) -> Evidence | None:
    """Drag by the force at each velocity, in relative errors; the inertia is not told."""
    force = base[axis.coefficient("alpha")] * np.array([abs(base.force(axis, command)) for command, _ in rows])
    v = np.abs(np.array([velocity for _, velocity in rows]))
    there = (force > 0.0) & (v > 0.0)
    if not there.any():
        return None
    F, v = force[there], v[there]
    top = float(v.max())
    (A, B), _ = nnls(np.column_stack([(v / top) ** 2, v / top]) / F[:, None], np.ones(len(F)))
    return Evidence(file, "velocity", Alone(False, nan, A / top**2, B / top, top, (inf, 0.1), 1.0))
