"""What is not identifiable from the data, and what speaks against the model, in words."""

from collections.abc import Iterator, Mapping

import numpy as np

from rov_fmu.identify.effects.coupling import is_coupled, is_told
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.response_fit import ResponseFit, predict, relative_rms
from rov_fmu.identify.points.thrust_fit import ThrustFit
from rov_fmu.identify.recordings.recordings_fit import Effect, RecordingsFit
from rov_fmu.identify.usable import is_pushed
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import REVERSE
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array


def on_thrust(thruster: str, fit: ThrustFit) -> Iterator[str]:
    """Warnings about a thrust curve."""
    if fit.estimate.degrees_of_freedom <= 0.0:
        yield f"{fit.counts.sum()} points for two coefficients leave no degree of freedom, so there are no intervals"
    for end, words in (("", ""), (REVERSE, " in reverse")) if "a_t" + REVERSE in fit.curve.keys else (("", ""),):
        a_t, b_t = (fit.values[fit.curve.coefficient(key + end)] for key in ("a_t", "b_t"))
        if b_t < 0.0 < a_t:
            yield f"the curve{words} points backward below {-b_t / a_t:.0%}; weigh high commands out (windows)"
    x = fit.x[fit.counts]
    told = np.abs(fit.y[fit.counts]) > 2.0 * fit.residual_rms
    x = x[told]
    yield from _asymmetry(x, fit.y[fit.counts][told], fit.value(x), "force", f"thrust_{thruster}")


def on_axis(result: AxisResult, base: Rov, thrust: Mapping[str, ThrustFit]) -> Iterator[str]:
    """Warnings about drag and β of an axis; `thrust` is of the curves that drive it, where they were tested."""
    axis, beta = result.axis, result.axis.coefficient("beta")
    if beta in result.assumed:
        yield (
            f"{axis.inertia}/{beta} is not identifiable from V_ss alone; {beta} = 1 is assumed, and every Tau follows "
            f"from it. A time constant or a recording of a step from rest makes it identifiable"
        )
    if result.estimate:
        yield from _on_drag(result, result.estimate)
    if still := sorted({p.command for p in result.points if not is_pushed(axis, base, p.command)}):
        yield (
            f"what moves at {join_names(f'{c:.0%}' for c in still)} is left out: the thrust curve gives no push there "
            f"(its dead band, or a slip in one of the tables)"
        )
    steady = [p for p in result.points if p.quantity == "V_ss"]
    x, y = np.array([p.command for p in steady]), np.array([p.value for p in steady])
    fitted = result.recordings or result.response
    model = predict(axis, fitted.rov if fitted else base, steady)
    yield from _asymmetry(x, y, model, "V_ss", axis.name)
    used = [abs(p.command) for p in result.points if p.weight > 0.0]
    for name, fit in thrust.items() if used else ():
        tested = np.abs(fit.x[fit.counts])
        if max(used) > tested.max() + 0.005 or min(used) < tested.min() - 0.005:
            yield (
                f"commands of {min(used):.0%} to {max(used):.0%} are used, but {name} thrust was tested "
                f"from {tested.min():.0%} to {tested.max():.0%} only"
            )
    if result.response and not result.recordings:
        yield from _on_response(result.response)
    if result.recordings:
        yield from _on_recordings(result, result.recordings)
        for fit in thrust.values():
            yield from _on_disagreement(result.recordings, fit)


def _on_drag(result: AxisResult, estimate: Estimate) -> Iterator[str]:
    if estimate.degrees_of_freedom <= 0.0:
        yield "as many coefficients as measurements leave no degree of freedom, so there are no intervals"
    for end in ("", REVERSE):
        a_d, b_d = (result.axis.coefficient(key + end) for key in ("a_d", "b_d"))
        if not {a_d, b_d} <= set(estimate.names) or estimate.degrees_of_freedom <= 0.0:
            continue
        wide = []
        for name in (a_d, b_d):
            interval = estimate.interval(name)
            if interval is None:
                wide.append(f"{name} is not identifiable at all")
            elif interval[1] - interval[0] > estimate[name]:
                wide.append(f"{name} may lie anywhere from {interval[0]:.3g} to {interval[1]:.3g}")
        if wide:
            correlation = estimate.correlation[estimate.names.index(a_d), estimate.names.index(b_d)]
            together = f" (correlation {correlation:.2f})" if np.isfinite(correlation) else ""
            yield (
                f"quadratic and linear drag are hardly identifiable apart: {', '.join(wide)}{together}; "
                f"identifiable is their sum at the velocities tested"
            )
    b_d = result.axis.coefficient("b_d")
    for name in estimate.names:
        if estimate[name] == 0.0 and name not in result.assumed:
            by_forces = result.drag if not result.recordings else None
            asked = f" (by (11)-(13) alone {by_forces.unbounded[name == b_d]:.3g})" if by_forces else ""
            yield f"{name} is at its bound of 0, the fit without bounds is negative{asked}, which drag cannot be"


def _on_response(fit: ResponseFit) -> Iterator[str]:
    for quantity in ("V_ss", "Tau"):
        inside, outside = fit.rms(quantity), fit.rms(quantity, leave_one_out=True)
        if outside > 0.02 and outside > 1.5 * inside:
            yield (
                f"the leave-one-thrust-out error of {quantity} is {outside:.1%} (RMS), the residual of the fit "
                f"{inside:.1%}: single thrusts carry much of it"
            )


def _on_recordings(result: AxisResult, fit: RecordingsFit) -> Iterator[str]:
    axis = fit.axis
    for s in fit.simulations:
        if is_coupled(fit.rov.layout, axis) and s.recording.command is None and not is_told(s.recording):
            yield (
                f"{s.recording.file} does not tell how fast the vehicle moves along or about the other axes, so their "
                f"coupling with {axis.name} is left out of the fit"
            )
        if s.correlation_time > 3.0 and s.noise > 1e-4 * float(np.ptp(s.measured)):
            yield (
                f"the residuals of {s.recording.file} are correlated over {s.correlation_time:.0f} samples, "
                f"so more than the sensor's noise (turbulence, tether, or the model); the intervals are widened for it"
            )
        share = s.outliers / len(s.time)
        if share > 0.03:
            yield f"{share:.0%} of the samples of {s.recording.file} are outliers and count less"
    if fit.disagreement:
        low, high = (f"{end(fit.disagreement.values()):.2g}" for end in (min, max))
        yield (
            f"the recordings disagree on {join_names(fit.disagreement)} by more than their residuals explain, so the "
            f"model misses something; intervals are {low if low == high else f'{low} to {high}'} times as wide for it"
        )
    held_out = fit.held_out
    if held_out.fit < 0.5 * held_out.possible:
        what = "the other half" if held_out.by_halves else "the others"
        yield f"each recording is predicted by {what} with a fit of {held_out.fit:.0f} % only: do not trust this axis"
    for effect in fit.effects:
        if effect.kept:
            yield _WORDS[effect.kind].format(effect.of, _number(effect.value), effect.unit, _range(effect))
    tables = [p for p in result.points if p.error is None and p.weight > 0.0]
    for quantity in ("V_ss", "Tau"):
        off = relative_rms(tables, predict(axis, fit.rov, tables), quantity)
        if off > 0.05:
            yield f"{quantity} of the tables is {off:.0%} (RMS) off what the recordings give"


_WORDS = {
    "load": "a constant load of {1} {2}{3} acts in {0} (net weight, tether), and is in the model",
    "delay": "the motion of {0} follows the commands {1} s late{3}; the delay is not in the model but told with it",
    "current": "the water moved at {1} {2}{3} in {0}, which is taken out",
    "current north": "the water moved north at {1} {2}{3} in {0}, which is taken out",
    "current east": "the water moved east at {1} {2}{3} in {0}, which is taken out",
    "dead band": "thrust of {0} begins at a command of {1}{3}, and that is in the model",
    "lag": "the thrust of {0} lags by {1} s{3}, and is in the model",
    "reverse thrust": "{0} thrust in reverse is {1} times that ahead{3}, and is in the model",
    "reverse drag": "drag of {0} in reverse is {1} times that ahead{3}, and is in the model",
}


def on_delay(fit: RecordingsFit) -> Iterator[str]:
    """What to put in front of the commands."""
    for effect in fit.effects:
        if effect.kept and effect.kind == "delay" and effect.of == fit.axis.name and effect.value > 0.0:
            yield (
                f"The motion in {fit.axis.name} followed the commands {_number(effect.value)} s late{_range(effect)}: "
                f"the model has no delay, put one in front of the commands."
            )


def _range(effect: Effect) -> str:
    return f" ({_number(effect.interval[0])} to {_number(effect.interval[1])})" if effect.interval else ""


def _number(value: float) -> str:
    return f"{value:.4g}"


def _on_disagreement(fit: RecordingsFit, thrust: ThrustFit) -> Iterator[str]:
    """Where the recordings bend the thrust curve away from what was tested."""
    for name in thrust.estimate.names:
        if name in fit.estimate.names:
            tested, error = thrust.estimate[name], thrust.estimate.errors[name]
            if abs(fit.estimate[name] - tested) > 3.0 * error:
                yield (
                    f"the recordings ask for {name} = {fit.estimate[name]:.3g}, while the thrust "
                    f"tests gave {tested:.3g} +- {error:.1g}: a thruster in motion is not one that is held"
                )


def _asymmetry(x: Array, y: Array, model: Array, what: str, window: str) -> Iterator[str]:
    """Both directions at the same command, where they differ by more than 5 %, and that from what the model gives."""
    ratios = {}
    for level in np.unique(np.round(np.abs(x[x < 0.0]), 6)).tolist():
        back, forth = np.isclose(x, -level), np.isclose(x, level)
        if forth.any() and y[forth].mean() > 0.0 and model[forth].mean() > 0.0:
            measured, modelled = (-float(part[back].mean() / part[forth].mean()) for part in (y, model))
            ratios[level] = measured - 1.0, measured / modelled - 1.0 if modelled else np.inf, modelled - 1.0
    if ratios:
        level = max(ratios, key=lambda c: abs(ratios[c][1]))
        measured, beyond, modelled = ratios[level]
        if abs(beyond) > 0.05:
            takes = "as equal" if abs(modelled) < 5e-4 else f"to differ by {modelled:+.0%}"
            yield (
                f"{what} differs by {measured:+.0%} from positive to negative commands at {level:.0%}, which "
                f"the model takes {takes}; windows.{window} picks a direction"
            )
