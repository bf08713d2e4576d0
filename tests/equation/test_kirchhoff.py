"""Invariants of Kirchhoff's equations: what stays constant while a body tumbles through still water without forces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rov_fmu.c.simulation import Array, simulate
from rov_fmu.vehicle.vehicle import Vehicle
from tests.often import spread
from tests.vehicles import SIX, frictionless, still
from verification.references import rigid_vehicle

TUMBLING = {"u": 0.4, "v": -0.6, "w": 0.3, "p": 1.7, "q": -1.1, "r": 2.3, "x": 5.0, "y": -3.0, "z": 2.0}
TUMBLING |= {"eta": 0.1, "epsilon_1": -0.7, "epsilon_2": 0.5, "epsilon_3": 0.5}  # of length 1
LENGTHS = pytest.mark.parametrize("h", spread([1e-3, 0.1, 10.0], [10.0], [1e-3]))
SECONDS = 100.0


def tumbled(rov: Vehicle, h: float) -> tuple[Array, Array, Array]:
    """Return the velocities, the positions and the rotation matrices of a tumbling vehicle; time is the last axis."""
    names = [*rov.layout.velocities, *"xyz", *rigid_vehicle.QUATERNION]
    times = np.arange(round(SECONDS / h) + 1) * h
    y = simulate(rov, times, TUMBLING, names, workers=1).values[:, 0]
    assert np.all(np.isfinite(y))
    assert np.ptp(y[:6], axis=1).min() > 0.1  # it does tumble
    return y[:6], y[6:9], np.moveaxis(Rotation.from_quat(y[9:].T, scalar_first=True).as_matrix(), 0, -1)


def drift(x: Array, size: float) -> float:
    """Return the largest change from the start, relative to a size."""
    return float(np.abs(x - x[..., :1]).max()) / size


@LENGTHS
def test_a_free_body_keeps_its_energy_and_its_impulses(h: float) -> None:
    rov = frictionless(SIX).with_(W=0.0, B=0.0)
    nu, x, R = tumbled(rov, h)
    momentum = rigid_vehicle.body(rov, still(rov)).mass @ nu
    linear = np.einsum("ijt,jt->it", R, momentum[:3])
    angular = np.cross(x, linear, axis=0) + np.einsum("ijt,jt->it", R, momentum[3:])
    energy, P, L = (nu * momentum).sum(axis=0), *(np.linalg.norm(vector, axis=0).max() for vector in (linear, angular))
    assert drift(energy, energy[0]) <= 1e-12
    assert drift(linear, P) <= 1e-12
    assert drift(angular, np.linalg.norm(x, axis=0).max() * P + L) <= 1e-12


@LENGTHS
def test_weight_and_buoyancy_keep_the_total_energy(h: float) -> None:
    rov = frictionless(SIX).with_(W=SIX["B"])  # neither sinks nor rises
    nu, x, R = tumbled(rov, h)
    body = rigid_vehicle.body(rov, still(rov))
    kinetic = 0.5 * (nu * (body.mass @ nu)).sum(axis=0)
    heights = [centre @ R[2] + x[2] for centre in (body.centre_of_buoyancy, body.centre_of_gravity)]
    energy = kinetic + body.buoyancy * heights[0] - body.weight * heights[1]
    assert drift(energy, kinetic.max() + body.weight * np.abs(x[2]).max()) <= 1e-12
