"""The declarations of a vehicle's variables (rov_fmu/model/layout.py)."""

import pytest

import rov_fmu
from rov_fmu.vehicle.shipped import SHIPPED

WORDS = {
    "videoray": {
        "u_l": "Command u_l: left thruster, positive forward; saturates at ±1",
        "Z_ext": "Load from outside in heave (tether, ballast), positive down",
        "u": "Surge velocity u through the water, positive forward",
        "r": "Yaw velocity r, positive bow to starboard",
        "F_l": "Thrust F_l: left thruster, (9), half of the pair's, positive forward",
        "m_rov": "Mass m_rov, (3a), (3b)",
        "a_d_u": "Quadratic drag coefficient a_d of surge, (14)",
        "alpha_r": "Tuning α_r: scales torque in yaw, (18c)",
    },
    "bluerov2_heavy": {
        "u_1": "Command u_1: thruster 1 (front starboard), positive astern and to starboard; saturates at ±1",
        "Y_ext": "Load from outside in sway (tether, contact), positive to starboard",
        "V_E": "Velocity of a steady horizontal current, eastward",
        "m_a_w": "Added mass m_a of heave",
        "m_a_r": "Added moment of inertia m_a of yaw",
        "T_t200": "Time constant T of the lag of the T200 at 16 V, T dF/dt = F(c) - F",
        "tau_t200": "Torque τ_t200 of the thrusters with the curve of the T200 at 16 V, positive bow to starboard",
    },
}


@pytest.mark.parametrize("name", WORDS)
def test_variables_are_described_in_the_terms_of_the_vehicle(name: str) -> None:
    layout = rov_fmu.load(SHIPPED[name]).layout
    declared = layout.inputs | layout.state | layout.thrust | layout.coefficients
    assert {key: declared[key].description for key in WORDS[name]} == WORDS[name]


def test_loads_and_velocities_have_the_units_and_sizes_of_their_axes() -> None:
    layout = rov_fmu.load("bluerov2_heavy").layout
    assert {n: (d.unit, d.nominal) for n, d in layout.inputs.items() if n.endswith("_ext")} == {
        "X_ext": ("N", 10.0),
        "Y_ext": ("N", 10.0),
        "Z_ext": ("N", 10.0),
        **dict.fromkeys(("K_ext", "M_ext", "N_ext"), ("N.m", 1.0)),
    }
    units = dict.fromkeys("uvw", "m/s") | dict.fromkeys("pqr", "rad/s")
    assert {n: d.unit for n, d in layout.velocities.items()} == units
