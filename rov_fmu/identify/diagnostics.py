"""Find what is not identifiable from the data, and what contradicts the model."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import fdtrc

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate, rms
from rov_fmu.identify.points.response_fit import ResponseFit, predict, relative_errors
from rov_fmu.identify.points.thrust_fit import ThrustFit, forces
from rov_fmu.identify.recordings.held_out import of_velocity
from rov_fmu.identify.recordings.prediction_errors import shown_in
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, RecordingsFit
from rov_fmu.identify.structure import on_structure
from rov_fmu.identify.usable import is_pushed
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import COUPLED_AXES, REVERSE, SURGE, SWAY, YAW, Layout, coefficient_name
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import Requests
from rov_fmu.tank.findings import Finding

_LEAST_EXPLAINED = 0.5
"""The least share of the change of velocity, beyond the sensor's noise, that a good model predicts."""
_BACKWARD = 0.005
"""If a thrust curve has the wrong sign only below this command, rounding is the reason."""
_CHANCE = 0.003
"""The probability of a false alarm about a difference between recordings and forces or tables."""
_SOME_OUTLIERS, _MANY_OUTLIERS = 0.03, 0.15
"""The shares of outliers above which they are reported, and above which a recording is doubtful."""
_TURNS = 0.05
"""The rate of turn above which a test of surge or sway is affected, rad/s."""
_SIGNIFICANT = 4.0
"""A difference between directions counts if it exceeds this number of standard errors. About ten commands are tested,
so chance hardly reaches it."""


def on_thrust(curve: str, fit: ThrustFit, rov: Rov) -> Iterator[Finding]:
    """Yield findings about a fit to forces; `rov` has the thrust curve as the recordings changed it."""
    finding = partial(Finding, curve=curve)
    if fit.estimate.degrees_of_freedom <= 0.0:
        yield finding("thrust without freedom", numbers={"count": int(fit.counts.sum())})
    of_vehicle = rov.layout.curves_by_name[curve]
    for end, kind in (("", "backward thrust"), (REVERSE, "backward thrust in reverse")):
        a_t, b_t = (rov[of_vehicle.coefficient(key + end)] for key in ("a_t", "b_t"))
        if "a_t" + end in of_vehicle.keys and a_t > 0.0 and -b_t / a_t > _BACKWARD:
            yield finding(kind, numbers={"command": -b_t / a_t})
    x, y = fit.x[fit.counts], fit.y[fit.counts]
    clear = np.abs(y) > 2.0 * fit.residual_rms
    noise = fit.residual_rms if f"a_t{REVERSE}" in of_vehicle.keys else 0.0  # a common curve leaves the asymmetry in it
    asymmetry = _asymmetry(x[clear], y[clear], fit.value(x[clear]), noise)
    if asymmetry:
        yield finding("asymmetry", names={"quantity": "force", "window": f"thrust_{curve}"}, numbers=asymmetry)


def on_turning(results: Iterable[AxisResult], rov: Rov) -> Iterator[Finding]:
    """Yield a finding for each axis with tables whose thrusters would also turn the vehicle; `rov` is the result."""
    yaw = [*rov.layout.kinds].index(YAW.name) if YAW.name in rov.layout.kinds else None
    for result in results:
        commands = {p.command for p in result.points if p.weight > 0.0}
        if yaw is None or result.axis not in (SURGE, SWAY) or result.chosen != "points" or not commands:
            continue
        turning = {c: rov.motions(rov.held_inputs(result.axis, c))[yaw].steady_velocity() for c in commands}
        command, rate = max(turning.items(), key=lambda turn: abs(turn[1]))
        if abs(rate) > _TURNS:
            numbers = {"command": command, "rate": abs(float(np.degrees(rate)))}
            yield Finding("tests turn", result.axis.name, numbers=numbers)


def on_voltage(rov: Rov, requests: Requests) -> Iterator[Finding]:
    """Yield a finding if the voltage was fitted, but the voltage of the thrust tests is not given."""
    fitted = [curve.name for curve in rov.layout.curves if "V_0" in curve.keys]
    if requests.voltage and (unsaid := [name for name in fitted if name not in requests.measured_at]):
        key = coefficient_name("V_0", unsaid[0])
        names = {"curves": join_names(unsaid), "key": key}
        yield Finding("unknown voltage", names=names, numbers={"voltage": rov[key]})


def on_axis(result: AxisResult, base: Rov, thrust: Mapping[str, ThrustFit]) -> Iterator[Finding]:
    """Yield findings about drag and β of an axis; `thrust` has the tested curves that drive it."""
    axis, beta = result.axis, result.axis.coefficient("beta")
    finding = partial(Finding, axis=axis.name)
    if beta in result.assumed:
        yield finding("assumed beta", names={"beta": beta, "inertia": axis.inertia})
    if result.estimate:
        yield from _on_drag(result, result.estimate)
    if still := sorted({p.command for p in result.points if not is_pushed(axis, base, p.command)}):
        yield finding("no push", names={"commands": join_names(f"{c:.0%}" for c in still)})
    steady = [p for p in result.points if p.quantity == "V_ss"]
    x, y = np.array([p.command for p in steady]), np.array([p.value for p in steady])
    fitted = result.recordings or result.response
    asymmetry = _asymmetry(x, y, predict(axis, fitted.rov if fitted else base, steady))
    if asymmetry:
        yield finding("asymmetry", names={"quantity": "V_ss", "window": axis.name}, numbers=asymmetry)
    used = [abs(p.command) for p in result.points if p.weight > 0.0 or p.is_read_off]
    for name, fit in thrust.items() if used else ():
        tested = np.abs(fit.x[fit.counts])
        if max(used) > tested.max() + 0.005 or min(used) < tested.min() - 0.005:
            numbers = {"tested_low": float(tested.min()), "tested_high": float(tested.max())}
            numbers |= {"low": min(used), "high": max(used)}
            yield finding("untested thrust", curve=name, numbers=numbers)
    if result.response and not result.recordings:
        yield from _on_response(result.response)
    if result.recordings:
        yield from _on_recordings(result, result.recordings)
        for fit in thrust.values():
            yield from on_forces(result.recordings, fit)


def _on_drag(result: AxisResult, estimate: Estimate) -> Iterator[Finding]:
    finding = partial(Finding, axis=result.axis.name)
    if estimate.degrees_of_freedom <= 0.0:
        yield finding("drag without freedom")
    for end in ("", REVERSE):
        a_d, b_d = (result.axis.coefficient(key + end) for key in ("a_d", "b_d"))
        if not {a_d, b_d} <= set(estimate.names) or estimate.degrees_of_freedom <= 0.0:
            continue
        names: dict[str, str] = {}
        numbers: dict[str, float] = {}
        for key, name in (("a_d", a_d), ("b_d", b_d)):
            interval = estimate.interval(name)
            if interval is None:
                names[key] = name
            elif interval[1] - interval[0] > estimate[name]:
                names[key] = name
                numbers |= {f"{key} low": interval[0], f"{key} high": interval[1]}
        if names:
            correlation = float(estimate.correlation[estimate.names.index(a_d), estimate.names.index(b_d)])
            if np.isfinite(correlation):
                numbers["correlation"] = correlation
            yield finding("inseparable drag", names=names, numbers=numbers)
    b_d = result.axis.coefficient("b_d")
    for name in estimate.names:
        if estimate[name] == 0.0 and name not in result.assumed:
            by_forces = result.drag if not result.recordings else None
            unbounded = by_forces.unbounded[name == b_d] if by_forces else 0.0
            numbers = {"unbounded": unbounded} if unbounded < 0.0 else {}
            yield finding("drag at zero", names={"coefficient": name}, numbers=numbers)


def _on_response(fit: ResponseFit) -> Iterator[Finding]:
    for quantity in ("V_ss", "Tau"):
        fitted, predicted = fit.rms(quantity), fit.rms(quantity, leave_one_out=True)
        if predicted > 0.02 and predicted > 1.5 * fitted:
            numbers = {"predicted": predicted, "fitted": fitted}
            yield Finding("leave-one-out error", fit.axis.name, names={"quantity": quantity}, numbers=numbers)


def _on_recordings(result: AxisResult, fit: RecordingsFit) -> Iterator[Finding]:
    axis = fit.axis
    finding = partial(Finding, axis=axis.name)
    for s in fit.simulations:
        file = s.recording.file
        if s.correlation_time > 3.0 and s.noise > 1e-4 * float(np.ptp(s.measured)):
            yield finding("correlated residuals", file=file, numbers={"samples": s.correlation_time})
        share = s.outliers / len(s.time)
        if share > _SOME_OUTLIERS:
            kind = "many outliers" if share > _MANY_OUTLIERS else "outliers"
            yield finding(kind, file=file, numbers={"share": share})
    if fit.between_rows:
        yield finding("switches between rows")
    yield from on_structure(fit)
    if factors := fit.disagreement:
        numbers = {"low": min(factors.values()), "high": max(factors.values())}
        yield finding("disagreement", names={"coefficients": join_names(factors)}, numbers=numbers)
    held_out = fit.held_out
    for file in held_out.failed:
        yield finding("failed prediction", file=file)
    if held_out.predictions and (errors := of_velocity(held_out.errors)).explained < _LEAST_EXPLAINED:
        factor, unit = shown_in(axis, "velocity")
        others = "the other half" if held_out.by_halves else "the others"
        numbers = dict(zip(("predicted", "unchanged", "noise"), (factor * rms for rms in errors.rms), strict=True))
        yield finding("poor prediction", names={"others": others, "unit": unit}, numbers=numbers)
    for effect in fit.effects:
        if effect.kept:
            yield _on_effect(fit, effect)
    tables = [p for p in result.points if not p.is_read_off and p.weight > 0.0]
    predicted = predict(axis, fit.rov, tables)
    for quantity in ("V_ss", "Tau"):
        commands, relative = relative_errors(tables, predicted, quantity)
        error = rms(relative)
        if error > 0.05 and not _is_scatter(commands, relative):
            yield finding("tables against recordings", names={"quantity": quantity}, numbers={"error": error})


def _is_scatter(commands: Array, errors: Array) -> bool:
    """Return True when the errors of predictions at n commands may be scatter about zero.

    Scatter has neither a mean nor a trend with the size of the command (an F-test). Fewer than five errors do not tell.
    """
    n = len(errors)
    if n < 5:
        return False
    A = np.column_stack([np.ones(n), np.abs(commands)])
    trend = A @ np.linalg.lstsq(A, errors, rcond=None)[0]
    within = float(np.sum((errors - trend) ** 2)) / (n - 2)
    return bool(fdtrc(2, n - 2, float(trend @ trend) / 2.0 / max(within, 1e-12)) > _CHANCE)


def _on_effect(fit: RecordingsFit, effect: FittedEffect) -> Finding:
    """Return the finding about an effect that is kept in the fit."""
    numbers = {"value": effect.value}
    if effect.interval:
        numbers |= {"low": effect.interval[0], "high": effect.interval[1]}
    found = Finding(effect.kind, axis=fit.axis.name, names={"unit": effect.unit}, numbers=numbers)
    if effect.of in {s.recording.file for s in fit.simulations}:
        return replace(found, file=effect.of)
    return replace(found, names={"unit": effect.unit, "of": effect.of})


def on_delay(fit: RecordingsFit) -> Iterator[Finding]:
    """Yield a finding about the delay of the axis, which the model leaves out."""
    for effect in fit.effects:
        if effect.kept and effect.kind == "delay" and effect.of == fit.axis.name and effect.value > 0.0:
            yield replace(_on_effect(fit, effect), kind="delay not modelled")


def on_coupling(recordings: Mapping[str, Sequence[Recording]], layout: Layout) -> Iterator[Finding]:
    """Yield a finding for each log that shows yaw with surge or sway, if the vehicle could have coupling but has none.

    `recordings` are given by axis name.
    """
    if layout.coupled or not all(layout.has(axis) for axis in COUPLED_AXES):
        return
    moving = {r.file for axis in (SURGE, SWAY) for r in recordings.get(axis.name, ())}
    for recording in recordings.get(YAW.name, ()):
        if recording.file in moving:
            yield Finding("coupling left out", file=recording.file)


def on_forces(fit: RecordingsFit, thrust: ThrustFit) -> Iterator[Finding]:
    """Yield a finding when the recordings change a thrust curve by more than the scatter of the forces allows.

    The increase of the sum of squares is compared with the scatter of the forces (an F-test).
    """
    own, curve = thrust.estimate, thrust.curve.name
    if not own.noise > 0.0 or not {*own.names} <= {*fit.estimate.names}:
        return
    x, counts = thrust.x, thrust.counts
    joint = forces(fit.rov.layout.curves_by_name[curve], fit.rov.coefficients, x)
    increase = float(np.sum((thrust.y - joint)[counts] ** 2) - np.sum(thrust.residuals[counts] ** 2))
    p = len(own.names)
    if fdtrc(p, own.degrees_of_freedom, max(increase, 0.0) / p / own.noise**2) < _CHANCE:
        alone = thrust.value(x)
        n = int(np.argmax(np.where(counts, np.abs(joint - alone), 0.0)))
        numbers = {"command": float(x[n]), "joint": float(joint[n]), "alone": float(alone[n])}
        yield Finding("recordings against forces", fit.axis.name, curve, numbers=numbers)


def _asymmetry(x: Array, y: Array, model: Array, noise: float = 0.0) -> dict[str, float] | None:
    """Compare both directions at the same command; return the numbers of a finding, or None.

    There is a finding if the ratio of the directions differs from the model by more than 5 %, and by more than noise
    and scatter explain.
    """
    ratios, scatter = {}, max(noise, _scatter(x, y))
    for level in np.unique(np.round(np.abs(x[x < 0.0]), 6)).tolist():
        backward, forward = np.isclose(x, -level), np.isclose(x, level)
        if forward.any() and y[forward].mean() > 0.0 and model[forward].mean() > 0.0:
            measured, modelled = (-float(part[backward].mean() / part[forward].mean()) for part in (y, model))
            difference = measured / modelled - 1.0 if modelled else np.inf
            errors = (
                scatter / np.sqrt(part.sum()) / max(abs(model[part].mean()), 1e-12) for part in (backward, forward)
            )
            if abs(difference) > _SIGNIFICANT * np.hypot(*errors):
                ratios[level] = measured - 1.0, difference, modelled - 1.0
    if not ratios:
        return None
    level = max(ratios, key=lambda c: abs(ratios[c][1]))
    measured, difference, modelled = ratios[level]
    if abs(difference) <= 0.05:
        return None
    numbers = {"measured": measured, "command": level}
    return numbers if abs(modelled) < 5e-4 else numbers | {"modelled": modelled}


def _scatter(x: Array, y: Array) -> float:
    """Return the standard deviation of measurements that were repeated at the same command; 0 without repetitions."""
    _, group, count = np.unique(np.round(x, 6), return_inverse=True, return_counts=True)
    means = np.bincount(group, y) / count
    return float(np.sqrt(np.sum((y - means[group]) ** 2) / max(len(y) - len(count), 1)))
