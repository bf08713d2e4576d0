"""Find wrong units, scales and signs in recordings and tables, with the file and the likely cause.

Every recording is examined by itself first (rov_fmu/identify/slips/single_recording.py), then all recordings of an axis
together (rov_fmu/identify/slips/explanation.py). If a finding is certain, the file is refused. Other findings become
warnings.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import inf, isfinite, nan

import numpy as np
from scipy.optimize import nnls

from rov_fmu.identify.adapter.recording import Recording, signal_name
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.identify.slips.explanation import CERTAIN, FASTEST, LIKELY, Evidence, Explanation, Files, contradict
from rov_fmu.identify.slips.single_recording import Alone, alone
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.findings import Finding

Tables = Mapping[str, Sequence[tuple[float, float]]]
"""Rows of a command and a number, by file."""
BETA = 0.05, 1.2
"""The range of β without added mass: m/β is between about the mass itself and 20 times the mass."""
BETA_WITH_ADDED_MASS = 0.3, 3.0
_ERROR_OF_MASS = 1.02
"""A β of at most this may be above 1 because of an error of 2 % of the mass or of the forces."""
_WEAKEST_COMMANDS = 0.01
"""Commands that never exceed this are fractions taken for percent."""
_ALIKE = 2.5
"""β of two axes may have the same cause of error if their ratio is below this."""
_FAR, _VERY_FAR = 20.0, 100.0
"""The ratio of time constants from which a file is doubtful, and from which it is refused."""


def slips(
    recordings: Mapping[str, Sequence[Recording]],
    base: Rov,
    known: Collection[str] = (),
    steady: Mapping[str, Tables] | None = None,
    time_constants: Mapping[str, Tables] | None = None,
) -> tuple[Finding, ...]:
    """Return the wrong units, scales and signs in recordings and tables, which are given by axis name.

    `base` has the thrust, the inertia and the other known coefficients. The tables have commands and velocities
    (m/s, rad/s), and commands and time constants (s).
    """
    found: list[Finding] = []
    for axis in (form.axis for form in base.layout.axes):
        name, evidence = axis.name, list[Evidence]()
        found += _examine_each(axis, recordings.get(name, ()), base, evidence)
        tables = [e for file, rows in (steady or {}).get(name, {}).items() if (e := _table(axis, base, file, rows))]
        found += [
            _too_fast(e.file, e.quantity, axis, e.alone.speed) for e in tables if e.alone.speed > FASTEST[axis.unit]
        ]
        evidence += tables
        vehicle = _given(axis, base, known)
        if evidence:
            explanations = Files(axis, base, evidence, vehicle).explanations()
            vehicle = explanations[0].vehicle
            found += _wrong_scales(axis, evidence, explanations)
        if vehicle:
            for file, rows in (time_constants or {}).get(name, {}).items():
                found += _wrong_time_constants(axis, base, vehicle, file, rows)
    wrong_scale = {finding.file for finding in found if finding.kind == "wrong scale" and finding.certain}
    return tuple(f for f in found if f.kind != "too fast" or f.file not in wrong_scale)


def beta_range(rov: Rov, axis: Axis) -> tuple[float, float, str]:
    """Return the range of β of known vehicles, and a phrase for the inertia that this vehicle's β means."""
    beta, has_added = axis.coefficient("beta"), "m_a" in rov.layout.kinds[axis.name].keys
    inertia = f"{1.0 / max(rov[beta], 1e-9):.3g} times {axis.inertia}{' and the added one' if has_added else ''}"
    return (*(BETA_WITH_ADDED_MASS if has_added else BETA), inertia)


def beta_out_of_range(rov: Rov, axis: Axis, intervals: Mapping[str, tuple[float, float]]) -> Finding | None:
    """Return a finding about a fitted β that no known vehicle has, or None.

    `intervals` has the intervals of coefficients by name. A β above 1 means a negative added mass; there is a finding
    unless the interval of β or a small error of the mass explains it.
    """
    beta, (low, high, inertia) = axis.coefficient("beta"), beta_range(rov, axis)
    names = {"beta": beta, "inertia": inertia, "mass": axis.inertia}
    value = rov[beta]
    if not low <= value <= high:
        numbers = {"value": value, "low": low, "high": high}
        return Finding("implausible beta", axis=axis.name, names=names, numbers=numbers)
    least, most = intervals.get(beta, (value, value))
    if min(least, value / _ERROR_OF_MASS) > 1.0 and "m_a" not in rov.layout.kinds[axis.name].keys:
        numbers = {"value": value, "low": least, "high": most}
        return Finding("inertia below mass", axis=axis.name, names=names, numbers=numbers)
    return None


def weak_thrust(rov: Rov, curves: Collection[str], axes: Iterable[Axis]) -> tuple[Finding, ...]:
    """Return findings about tested thrust curves that must be too weak: one for each axis that such a curve drives.

    All axes of such a curve have about the same β, and it is beyond those of known vehicles.
    """
    found: list[Finding] = []
    by_curve: dict[str, list[Axis]] = {}
    for axis in axes:
        drivers = [*{thruster.curve for thruster in rov.layout.drivers(axis)}]
        if len(drivers) == 1 and drivers[0] in curves:
            by_curve.setdefault(drivers[0], []).append(axis)
    for curve, driven in by_curve.items():
        betas = [rov[axis.coefficient("beta")] for axis in driven]
        beyond = [beta > beta_range(rov, axis)[1] for axis, beta in zip(driven, betas, strict=True)]
        if len(driven) > 1 and all(beyond) and max(betas) < _ALIKE * min(betas):
            together = rov.layout.curves_by_name[curve].together
            names = {"factor": repr(float(np.exp(np.mean(np.log(betas))))), "together": str(together)}
            found += [Finding("weak thrust", axis.name, curve, names=names) for axis in driven]
    return tuple(found)


def _examine_each(
    axis: Axis, recordings: Sequence[Recording], base: Rov, evidence: list[Evidence]
) -> Iterator[Finding]:
    """Yield findings about single recordings, and append the analysis of each one to `evidence`."""
    for recording in recordings:
        data = prepare(recording, base)
        strongest = float(np.abs(data.commands).max(initial=0.0))
        if 0.0 < strongest <= _WEAKEST_COMMANDS:
            numbers = {"percent": 100.0 * strongest}
            yield Finding("fractions as percent", axis.name, file=recording.file, numbers=numbers, certain=True)
            continue
        if data.speed > FASTEST[axis.unit]:
            yield _too_fast(recording.file, recording.quantity, axis, data.speed)
        if (found := alone(data, base)) is not None:
            evidence.append(Evidence(recording.file, recording.quantity, found))
            if found.turned:
                names = {"quantity": signal_name(axis, recording.quantity), "positive": axis.positive.capitalize()}
                yield Finding("wrong sign", axis.name, file=recording.file, names=names, certain=found.is_clear)


def _wrong_scales(axis: Axis, evidence: Sequence[Evidence], explanations: Sequence[Explanation]) -> Iterator[Finding]:
    """Yield a finding for each file that has a wrong scale by the best explanation."""
    best = explanations[0]
    gained = next(e.cost for e in explanations if not e.files) - best.cost
    if not best.files or gained < LIKELY:
        return
    other = contradict(explanations)
    for one in evidence:
        if one.file in best.files:
            names = {
                "quantity": signal_name(axis, one.quantity),
                "unit": _unit(one.quantity, axis),
                "factor": repr(best.factor),
                "others": ", ".join(sorted(other.files)) if other else "",
            }
            certain = gained >= CERTAIN and one.alone.is_clear
            yield Finding("wrong scale", axis.name, file=one.file, names=names, certain=certain)


def _wrong_time_constants(
    axis: Axis, base: Rov, vehicle: Alone, file: str, rows: Sequence[tuple[float, float]]
) -> Iterator[Finding]:
    """Yield a finding where time constants are far from those of the vehicle.

    Where the inertia of the vehicle is unknown, a typical one is used.
    """
    inertia = vehicle.inertia if isfinite(vehicle.inertia) else 2.0 * base.inertia(base.layout.kinds[axis.name])
    alpha = base[axis.coefficient("alpha")]
    ratios = [
        Tau * abs(alpha * base.force(axis, c)) / inertia / vehicle.steady(abs(alpha * base.force(axis, c)))
        for c, Tau in rows
        if base.force(axis, c)
    ]
    ratio = float(np.median(ratios)) if ratios else 1.0
    if not 1.0 / _FAR < ratio < _FAR:
        kind = "slow time constants" if ratio > 1.0 else "fast time constants"
        certain = not 1.0 / _VERY_FAR < ratio < _VERY_FAR
        yield Finding(kind, axis.name, file=file, numbers={"ratio": ratio}, certain=certain)


def _unit(quantity: str, axis: Axis) -> str:
    return axis.unit if quantity == "velocity" else axis.position_unit


def _too_fast(file: str, quantity: str, axis: Axis, speed: float) -> Finding:
    names = {"quantity": signal_name(axis, quantity), "unit": _unit(quantity, axis), "speed_unit": axis.unit}
    return Finding("too fast", axis.name, file=file, names=names, numbers={"speed": speed}, certain=True)


def _given(axis: Axis, base: Rov, known: Collection[str]) -> Alone | None:
    """Return the vehicle where all of drag and β is known, or None."""
    form = base.layout.kinds[axis.name]
    names = [axis.coefficient("beta"), form.coefficient("a_d"), form.coefficient("b_d")]
    if not set(names) <= set(known):
        return None
    return Alone(False, base.effective_inertia(form), base[names[1]], base[names[2]], 1.0, (0.0, 0.0), 1.0)


def _table(axis: Axis, base: Rov, file: str, rows: Sequence[tuple[float, float]]) -> Evidence | None:
    """Fit the drag to the force at each velocity, with relative errors; a table does not show the inertia."""
    force = base[axis.coefficient("alpha")] * np.array([abs(base.force(axis, command)) for command, _ in rows])
    v = np.abs(np.array([velocity for _, velocity in rows]))
    usable = (force > 0.0) & (v > 0.0)
    if not usable.any():
        return None
    F, v = force[usable], v[usable]
    top = float(v.max())
    (A, B), _ = nnls(np.column_stack([(v / top) ** 2, v / top]) / F[:, None], np.ones(len(F)))
    return Evidence(file, "velocity", Alone(False, nan, A / top**2, B / top, top, (inf, 0.1), 1.0))
