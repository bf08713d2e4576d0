"""The dependencies of vehicles, as they can be read off their equations."""

from rov_fmu.equation.dependencies import dependencies_of, parameters_of
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import HEAVY, SIX, THRUST_EFFECTS, VIDEORAY


def test_every_kind_of_dependency_of_a_vehicle_with_lag() -> None:
    """Of the BlueROV2 Heavy. A thruster that pushes down loses no thrust by another speed than that of heave."""
    found = dependencies_of(HEAVY.layout)
    assert found["der(z)"] == {"w": "constant"}
    assert found["der(F_1)"]["F_1"] == "fixed"
    assert found["der(w)"] == {"Z_ext": "tunable", "w": "dependent"} | {f"F_{n}": "tunable" for n in "5678"}
    assert found["der(x)"] == {"V_N": "constant", "u": "dependent", "v": "dependent", "psi": "dependent"}
    thrusts = dependencies_of(load_vehicle(THRUST_EFFECTS).layout)
    assert thrusts["der(w)"] == {"Z_ext": "tunable", "voltage": "dependent", "w": "dependent"}
    brought = parameters_of(VIDEORAY.layout)
    assert (brought["der(z)"], brought["F_t"], brought["der(psi)"]) == ((), ("a_t_top", "b_t_top", "health_t"), ())
    assert brought["der(w)"] == ("m_rov", "a_t_top", "b_t_top", "a_d_w", "b_d_w", "alpha_w", "beta_w", "health_t")


def test_an_attitude_at_the_start_depends_on_the_angles_that_give_it() -> None:
    """An angle beyond its range turns the other two, so roll and heading depend on the pitch."""
    found = parameters_of(SIX.layout)
    assert {name: found[name] for name in ("eta", "phi", "theta", "psi")} == {
        "eta": ("phi_0", "theta_0", "psi_0"),
        "phi": ("phi_0", "theta_0"),
        "theta": ("theta_0",),
        "psi": ("theta_0", "psi_0"),
    }
    assert {"W", "z_B", "theta_0"} <= {*found["der(q)"]}
