"""The limits of the checks of a vehicle: each is allowed itself, and what is just beyond it is not."""

from typing import Any

import pytest

from rov_fmu.equation.catalogue import SURGE, SWAY
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import VehicleAxis
from rov_fmu.vehicle.geometry import check_mass
from rov_fmu.vehicle.quantity import derivative_hint
from tests.vehicles import numbered


def lines(of: Any) -> list[str]:
    """Return the places and reasons of some mistakes as text."""
    return [str(line) for line in of]


# ---- Numbers and names ----


@pytest.mark.parametrize(
    ("key", "hint"),
    {
        "I_x": "; write I_p in [body]",
        "Zdotw": "; give -Z_wdot, which is positive, as m_a of [axes.heave]",
        "N_r|r|": "; give -N_r|r|, which is positive, as a_d of [axes.yaw]",
        "Xuu": "; give -X_u|u|, which is positive, as a_d of [axes.surge]",
        "M_q": "; give -M_q, which is positive, as b_d of [axes.pitch]",
        "Y_rdot": "; give its negative as m_a_vr in [cross]",
        "N_v|v|": "; give its negative as a_d_rv in [cross]",
        "N_v|r|": "",
        "Y_r": "; give its negative as b_d_vr in [cross]",
        "Q_u": "",
    }.items(),
)
def test_what_replaces_a_derivative_is_told(key: str, hint: str) -> None:
    assert derivative_hint(key) == hint


# ---- Mass, damping, weight ----


@pytest.mark.parametrize("m", [16.0, -16.0, 15.98, -15.98, 16.02, -16.02])
def test_an_entry_of_the_mass_matrix_is_less_than_the_mean_of_the_masses(m: float) -> None:
    axes = tuple(VehicleAxis(axis, ("m_a", "a_d", "b_d")) for axis in (SURGE, SWAY))
    rov = numbered(Layout(axes, (), (), cross=(("m_a", "u", "v"),)), m_a_u=24.0, m_a_v=0.0, m_a_uv=m, m_rov=8.0)
    found = lines(check_mass(rov.layout, {**rov.coefficients, "beta_u": 0.25}))
    if abs(m) == 16.0:
        assert found[0].startswith("cross: the mass matrix must be positive definite, not singular")
    elif abs(m) < 16.0:
        assert found == []
    else:
        assert f"must be within ±16 for a positive definite matrix, but it is {m}" in found[0]
    assert len(found) == (abs(m) >= 16.0)
