"""The simulated pool of pool.py for vehicles that roll and pitch: the rigid body of rigid_body.py in six degrees.

Commands and conditions are those of pool.py.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

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

    fine = np.union1d(time, np.arange(time[0], time[-1], _FINEST))
    start = np.zeros(13 + len(k.layout.lagging))
    start[6] = 1.0
    y = pool.piecewise(partial(_rates, k, conditions), k.layout, commands, fine, conditions, start, _PRECISION)
    psi, theta, phi = Rotation.from_quat(y[6:10].T, scalar_first=True).as_euler("ZYX").T
    names = (*rigid_body.VELOCITIES, "x", "y", "z", "phi", "theta", "psi")
    found = np.stack([*y[:6], *y[10:13], phi, theta, np.unwrap(psi)])
    return dict(zip(names, found[:, np.searchsorted(fine, time)], strict=True))


def _rates(k: Vehicle, conditions: Conditions, command: Array) -> pool.Rates:
    inputs = {f"u_{t.name}": c for t, c in zip(k.layout.thrusters, command.tolist(), strict=True)}
    held = rigid_vehicle.body(k, inputs | dict(zip(("V_N", "V_E"), conditions.current, strict=True)))

    def rates(time: float, y: Array) -> Array:
        """The thrust changes with the time, and the tether pulls at the place of the vehicle."""
        thrust = conditions.thrust(time) if conditions.thrust else 1.0
        pull = -rigid_body.rotation(y[6:10]).T @ (np.array(conditions.tether) * y[10:13])
        now = replace(held, load=held.load + np.append(pull, np.zeros(3)), targets=thrust * held.targets)
        return rigid_body.rates(now, held.inverse, y)

    return rates
