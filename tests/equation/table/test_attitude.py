"""The attitude in formulas: angles, quaternion and rotation matrix (rov_fmu/equation/attitude.py)."""

from math import cos, pi, sin

import pytest

from rov_fmu.equation.attitude import (
    QUATERNION,
    angle_formulas,
    quaternion_formulas,
    rotation_formulas,
    start_angle_formulas,
    start_formulas,
)
from rov_fmu.equation.expression import compiled

ENTRIES = [f"R_{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
TURNS = [(0.0, 0.0, 0.0), (pi, 0.0, 0.0), (0.0, 0.0, pi), (pi, 0.0, pi)]
"""No turn, and half a turn about each axis. The small parts of the quaternion beside it are known to few digits."""
ATTITUDES = {
    "level, to the north": (0.0, 0.0, 0.0),
    "tilted and turned": (0.4, -0.3, 1.1),
    "on its side": (3.0, 0.2, 0.1),
    "nose over": (0.1, 1.4, 3.0),
    "to the south": (0.2, -0.1, 3.1),
    "past a vertical nose": (0.3, 2.0, -0.5),
    **{
        f"a little beside {turn}": tuple(a + b for a, b in zip(turn, (1e-7, 2e-7, -3e-7), strict=True))
        for turn in TURNS
    },
}


def rotation(phi: float, theta: float, psi: float) -> list[float]:
    """Return R_z(psi) R_y(theta) R_x(phi), the product of three plane rotations, by rows."""
    x = [[1.0, 0.0, 0.0], [0.0, cos(phi), -sin(phi)], [0.0, sin(phi), cos(phi)]]
    y = [[cos(theta), 0.0, sin(theta)], [0.0, 1.0, 0.0], [-sin(theta), 0.0, cos(theta)]]
    z = [[cos(psi), -sin(psi), 0.0], [sin(psi), cos(psi), 0.0], [0.0, 0.0, 1.0]]
    for factor in (y, x):
        z = [[sum(row[k] * factor[k][j] for k in range(3)) for j in range(3)] for row in z]
    return [entry for row in z for entry in row]


@pytest.mark.parametrize("angles", ATTITUDES.values(), ids=ATTITUDES)
def test_angles_become_a_quaternion_a_matrix_and_angles_again(angles: tuple[float, float, float]) -> None:
    start = dict(zip(("phi_0", "theta_0", "psi_0"), angles, strict=True))
    q = compiled(start_formulas())(start)
    expected = pytest.approx(rotation(*angles), abs=1e-15)
    by_angles = compiled(start_angle_formulas())(start)
    assert [by_angles[name] for name in ENTRIES] == expected
    for length in (1.0, 2.0):  # the quaternion need not have length 1
        R = compiled(rotation_formulas())({name: length * q[name] for name in QUATERNION})
        assert [R[name] for name in ENTRIES] == expected
    found = compiled(angle_formulas())(R)
    again = rotation(*(found[name] for name in ("phi", "theta", "psi")))
    assert again == expected
    assert by_angles["theta"] == pytest.approx(found["theta"], abs=1e-15)
    assert -0.5 * pi <= found["theta"] <= 0.5 * pi
    for sign in (1.0, -1.0):  # the new quaternion has the sign of the old one
        old = {name: sign * q[name] for name in QUATERNION}
        back = compiled(quaternion_formulas())({**R, **old})
        assert [back[f"next_{name}"] for name in QUATERNION] == pytest.approx([*old.values()], abs=1e-15)
