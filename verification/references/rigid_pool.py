"""The simulated pool of pool.py for vehicles that roll and pitch: the rigid body of rigid_body.py in six degrees.

Commands and conditions are those of pool.py. A tilt has no meaning here, because the vehicle rolls and pitches itself.
"""

from dataclasses import replace

import numpy as np

from rov_fmu.vehicle.vehicle import Vehicle

from . import pool, rigid_body, rigid_vehicle
from .pool import NOTHING, Array, Commands, Conditions

_PRECISION = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-11}
_FINEST = 0.1
"""The longest time between two headings that are taken as less than half a turn apart, s."""


def motion(k: Vehicle, commands: Commands, time: Array, conditions: Conditions = NOTHING) -> dict[str, Array]:
    """Return u, v, w, p, q, r through the water, x, y, z, phi, theta and psi at ascending times (s), in SI units.

    The vehicle starts upright and at rest, with a heading of north. The heading does not wrap.
    """
    assert k.layout.has_attitude
    assert not k.layout.mix
    assert not conditions.tilt

    def rates(command: Array) -> pool.Rates:
        return _rates(k, command, conditions)

    fine = np.union1d(time, np.arange(time[0], time[-1], _FINEST))
    start = np.zeros(13 + len(k.layout.lagging))
    start[6] = 1.0
    y = pool.piecewise(rates, k.layout, commands, fine, conditions, start, _PRECISION)
    R = np.array([rigid_body.rotation(column) for column in y[6:10].T.tolist()])
    found = dict(zip((*rigid_body.VELOCITIES, *"xyz"), (*y[:6], *y[10:13]), strict=True))
    found["phi"] = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    found["theta"] = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 2, 1], R[:, 2, 2]))
    found["psi"] = np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    asked = np.searchsorted(fine, time)
    return {name: values[asked] for name, values in found.items()}


def _rates(k: Vehicle, command: Array, conditions: Conditions) -> pool.Rates:
    inputs = {f"u_{t.name}": c for t, c in zip(k.layout.thrusters, command.tolist(), strict=True)}
    held = rigid_vehicle.body(k, inputs | dict(zip(("V_N", "V_E"), conditions.current, strict=True)))
    held = replace(held, propellers=[replace(p, target=float(p.target)) for p in held.propellers])
    inverse = [[float(x) for x in row] for row in held.inverse]
    changes = conditions.thrust is not None or any(conditions.tether)

    def rates(time: float, state: Array) -> list[float]:
        y = state.tolist()
        return rigid_body.rates(_changed(held, conditions, time, y) if changes else held, inverse, y)

    return rates


def _changed(held: rigid_body.Body, conditions: Conditions, time: float, y: list[float]) -> rigid_body.Body:
    """Return the rigid body with its thrust at a time, and the pull of the tether at its place."""
    thrust, R = conditions.thrust(time) if conditions.thrust else 1.0, rigid_body.rotation(y[6:10])
    earth = [-stiffness * x for stiffness, x in zip(conditions.tether, y[10:13], strict=True)]
    pull = [sum(R[row][column] * earth[row] for row in range(3)) for column in range(3)]
    load = [*(x + F for x, F in zip(held.load[:3], pull, strict=True)), *held.load[3:]]
    return replace(held, load=load, propellers=[replace(p, target=thrust * p.target) for p in held.propellers])
