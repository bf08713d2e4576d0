"""Logs as ArduSub writes them: a vehicle flies by the law of ardusub.py, and the log has momentary commands.

The law runs at 400 Hz and follows noisy estimates of the attitude, the rates, the depth (a barometer with noise of 2 cm
behind a filter of 1 Hz) and the velocity down. The log has the commands of the moment, ten times a second, which is a
small part of what the thrusters get.
"""

from math import exp, sqrt

import numpy as np

from rov_fmu.c.stepper import Stepper
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references.autopilot.ardusub import STICK, VECTORED, VECTORED_6DOF, Hold, Motion, part_of

RATE = 400
"""Steps of the law per second."""
BAROMETER = 0.02
"""The standard deviation of its noise, m."""
ESTIMATES = {"attitude": (0.002, 0.5), "rates": (0.004, 0.02), "sinking": (0.01, 0.3)}
"""Of the errors of each estimate: the standard deviation, rad, rad/s or m/s, and the correlation time, s."""
NOISE = {"surge velocity [m/s]": 0.01, "sway velocity [m/s]": 0.01, "depth [m]": 0.01, "heading [deg]": 0.5}
"""The standard deviations of the noise of the log."""
_STICKS = (0.0, 0.3, -0.3, 0.5, -0.5, 0.7)


def flown(vehicle: Vehicle, seconds: float, seed: int, rows_per_second: int = 10) -> str:
    """Return the log of a flight with random sticks, depths and headings as a CSV file."""
    rng, dt = np.random.default_rng(seed), 1.0 / RATE
    layout = vehicle.layout
    names = [*(f.axis.velocity for f in layout.axes), "psi", "z", *(f"der({f.axis.velocity})" for f in layout.axes)]
    names += ["phi", "theta"] if layout.has_attitude else []
    stepper = Stepper(vehicle, {"z": 1.0}, names)
    hold = Hold(1.0, 0.0, frame=VECTORED if len(layout.thrusters) == len(VECTORED) else VECTORED_6DOF)
    now = dict.fromkeys([*"uvwpqr", "phi", "theta", "psi", *(f"der({v})" for v in "uvwpqr")], 0.0) | {"z": 1.0}
    errors = {key: np.zeros(1 if key == "sinking" else 3) for key in ESTIMATES}
    sticks, moved, depth = np.zeros(2), np.zeros(2), 1.0
    titles = [title for title, variable in zip(NOISE, ("u", "v", "z", "psi"), strict=True) if variable in names]
    lines = [",".join(["time [s]", *(f"{t.name} [1]" for t in layout.thrusters), *titles])]
    for step in range(round(seconds * RATE)):
        if step % (2 * RATE) == 0:
            sticks = rng.choice(_STICKS, 2)
        if step % (5 * RATE) == 0:
            hold.heading += float(rng.uniform(-1.5, 1.5))
            hold.depth = 1.0 + float(rng.uniform(0.0, 1.5))
        for key, (size, time) in ESTIMATES.items():
            kept = exp(-dt / time)
            errors[key] = kept * errors[key] + size * sqrt(1.0 - kept**2) * rng.standard_normal(len(errors[key]))
        depth += part_of(1.0, dt) * (now["z"] + BAROMETER * rng.standard_normal() - depth)
        attitude, rates = (
            tuple((np.array([now[name] for name in some]) + errors[key]).tolist())
            for key, some in (("attitude", ("phi", "theta", "psi")), ("rates", "pqr"))
        )
        sinking = now["w"] + float(errors["sinking"][0])
        moved += (sticks - moved) * dt / (dt + STICK)
        outputs = hold.outputs(
            Motion(attitude, rates, depth, sinking, now["der(w)"]), float(moved[0]), float(moved[1]), dt
        )
        if step % (RATE // rows_per_second) == 0:
            true = {"u": now["u"], "v": now["v"], "z": now["z"], "psi": np.degrees(now["psi"])}
            shown = [true[v] for v in ("u", "v", "z", "psi") if v in names] + np.array([NOISE[t] for t in titles]) * (
                rng.standard_normal(len(titles))
            )
            lines.append(",".join(f"{x:.6g}" for x in (step * dt, *outputs, *shown)))
        now |= zip(names, stepper.step(outputs, dt)[-len(names) :], strict=True)
    return "\n".join(lines) + "\n"
