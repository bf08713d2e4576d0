"""What is not identifiable from the data, and what speaks against the model, in words."""

from collections.abc import Iterator

import numpy as np

from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Array, Estimate
from rov_fmu.identify.output_error import RecordingsFit
from rov_fmu.identify.quadratic_fit import QuadraticFit
from rov_fmu.identify.response_fit import ResponseFit, predict, relative_rms
from rov_fmu.identify.tank_tests import thrust_names, thruster_of
from rov_fmu.motion.rov import Rov


def on_thrust(thruster: str, fit: QuadraticFit) -> Iterator[str]:
    """Warnings about a thrust curve."""
    if fit.estimate.degrees_of_freedom <= 0.0:
        yield f"{fit.counts.sum()} points for two coefficients leave no degree of freedom, so there are no intervals"
    if fit.b < 0.0 < fit.a:
        yield f"the curve points backward below {-fit.b / fit.a:.0%}; weigh high commands out (windows)"
    yield from _asymmetry(fit.x[fit.counts], fit.y[fit.counts], "force", f"thrust_{thruster}")


def on_axis(result: AxisResult, base: Rov, thrust: QuadraticFit | None) -> Iterator[str]:
    """Warnings about drag and β of an axis."""
    axis, beta = result.axis, result.axis.coefficient("beta")
    if beta in result.assumed:
        yield (
            f"{axis.inertia}/{beta} is not identifiable from V_ss alone; {beta} = 1 is assumed, and every Tau follows "
            f"from it. A time constant or a recording of a step from rest makes it identifiable"
        )
    if result.estimate:
        yield from _on_drag(result, result.estimate)
    steady = [p for p in result.points if p.quantity == "V_ss"]
    x, y = np.array([p.command for p in steady]), np.array([p.value for p in steady])
    yield from _asymmetry(x, y, "V_ss", axis.name)
    used = [abs(p.command) for p in result.points if p.weight > 0.0]
    if thrust is not None and used:
        tested = np.abs(thrust.x[thrust.counts])
        if max(used) > tested.max() + 0.005 or min(used) < tested.min() - 0.005:
            yield (
                f"commands of {min(used):.0%} to {max(used):.0%} are used, but {thruster_of(axis)} thrust was tested "
                f"from {tested.min():.0%} to {tested.max():.0%} only"
            )
    if result.response and not result.recordings:
        yield from _on_response(result.response)
    if result.recordings:
        yield from _on_recordings(result, result.recordings, base)
        if thrust is not None:
            yield from _on_disagreement(result.recordings, thrust)


def _on_drag(result: AxisResult, estimate: Estimate) -> Iterator[str]:
    a_d, b_d = result.axis.coefficient("a_d"), result.axis.coefficient("b_d")
    if estimate.degrees_of_freedom <= 0.0:
        yield "as many coefficients as measurements leave no degree of freedom, so there are no intervals"
    elif a_d in estimate.names and b_d in estimate.names:
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
    for name in estimate.names:
        if estimate[name] == 0.0:
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


def _on_recordings(result: AxisResult, fit: RecordingsFit, base: Rov) -> Iterator[str]:
    axis = fit.axis
    for s in fit.simulations:
        if s.correlation_time > 3.0 and s.noise > 1e-4 * float(np.ptp(s.measured)):
            yield (
                f"the residuals of {s.recording.file} are correlated over {s.correlation_time:.0f} samples, "
                f"so more than the sensor's noise (turbulence, tether, or the model); the intervals are widened for it"
            )
        share = s.outliers / len(s.time)
        if share > 0.03:
            yield f"{share:.0%} of the samples of {s.recording.file} are outliers and count less"
    weakest = min((abs(p.command) for p in result.points), default=1.0)
    if fit.load.is_significant and abs(fit.load.value) > 0.02 * abs(base.force(axis, weakest)):
        yield (
            f"the recordings show a constant load of {fit.load.value:.3g} {axis.load} (ballast, tether), which "
            f"is not in the model; the other coefficients are biased by it"
        )
    if fit.delay.is_significant and abs(fit.delay.value) > 0.02:
        yield (
            f"the motion {'lags' if fit.delay.value > 0.0 else 'leads'} the commands by "
            f"{abs(fit.delay.value):.2f} s beyond what the model gives; a delay is not in the model and biases beta"
        )
    tables = [p for p in result.points if p.error is None and p.weight > 0.0]
    for quantity in ("V_ss", "Tau"):
        off = relative_rms(tables, predict(axis, fit.rov, tables), quantity)
        if off > 0.05:
            yield f"{quantity} of the tables is {off:.0%} (RMS) off what the recordings give"


def _on_disagreement(fit: RecordingsFit, thrust: QuadraticFit) -> Iterator[str]:
    """Where the recordings bend the thrust curve away from what was tested."""
    for name in thrust_names(fit.axis):
        if name in fit.estimate.names:
            tested, error = thrust.estimate[name], thrust.estimate.errors[name]
            if abs(fit.estimate[name] - tested) > 3.0 * error:
                yield (
                    f"the recordings ask for {name} = {fit.estimate[name]:.3g}, while the thrust "
                    f"tests gave {tested:.3g} +- {error:.1g}: a thruster in motion is not one that is held"
                )


def _asymmetry(x: Array, y: Array, what: str, window: str) -> Iterator[str]:
    """Both directions at the same command, where they differ by more than 5 %."""
    ratios = {}
    for level in np.unique(np.round(np.abs(x[x < 0.0]), 6)).tolist():
        back, forth = (np.abs(y[np.isclose(x, sign * level)]) for sign in (-1.0, 1.0))
        if forth.size and forth.mean() > 0.0:
            ratios[level] = float(back.mean() / forth.mean()) - 1.0
    if ratios and max(map(abs, ratios.values())) > 0.05:
        level = max(ratios, key=lambda c: abs(ratios[c]))
        yield (
            f"{what} differs by {ratios[level]:+.0%} from positive to negative commands at {level:.0%}, which "
            f"the model takes as equal; windows.{window} picks a direction"
        )
