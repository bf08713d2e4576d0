"""A vehicle in waves: the velocity, acceleration and elevation of the water are inputs (docs/waves.md)."""

import random
from math import atan
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle, read_vehicle, without_surface
from rov_fmu.vehicle.writer import vehicle_text
from tests.equation.steps import in_engine, in_python
from tests.fmi import OK
from tests.fmu.calls.conftest import WRAPPERS
from tests.vehicles import SIX, a_vehicle, in_waves, random_inputs, random_state, surfaced
from verification.references.rigid_vehicle import compared, integrate, places

G = 9.80665
HEAVY, BLUEROV2, VIDEORAY = (load_vehicle(SHIPPED[name]) for name in ("bluerov2_heavy", "bluerov2", "videoray"))


ROVS = {"BlueROV2 (level)": without_surface(BLUEROV2), "six axes": SIX, "Heavy": without_surface(HEAVY)}


@pytest.mark.parametrize("name", ROVS)
def test_a_step_in_accelerated_water_is_exact(name: str) -> None:
    rng, rov = random.Random(name), in_waves(ROVS[name])
    for h in (0.02, 1.0):
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        inputs |= {f"A_{direction}": rng.uniform(-4.0, 4.0) for direction in "NED"}
        exact = compared(rov, integrate(rov, inputs, places(rov, state), h).tolist())
        for step in (in_python, in_engine):
            moved = compared(rov, places(rov, step(rov, inputs, state, h)))
            assert [float(x) for x in moved] == pytest.approx(exact, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("rov", [BLUEROV2, HEAVY, VIDEORAY, SIX], ids=["BlueROV2", "Heavy", "VideoRay", "six axes"])
def test_in_still_water_a_vehicle_moves_as_without_waves(rov: Vehicle) -> None:
    wavy = in_waves(rov)
    inputs, state = random_inputs(random.Random(1), rov), random_state(random.Random(2), rov)
    for h in (0.01, 0.5):
        for step in (in_python, in_engine):
            moved = step(wavy, wavy.layout.usual_inputs | inputs, state, h)
            same = step(rov, inputs, state, h)
            assert moved == (pytest.approx(same, rel=1e-13, abs=1e-13) if rov.layout.surface else same)


@pytest.mark.parametrize("rov", [BLUEROV2, surfaced(SIX, 0.3)], ids=["level", "six axes"])
def test_depth_counts_from_the_elevated_surface(rov: Vehicle) -> None:
    """A vehicle at depth z under a surface that is e higher moves as one at depth z + e."""
    rng, wavy = random.Random(3), in_waves(rov)
    for z, elevation in ((0.3, -0.4), (-0.2, 0.25), (-0.9, 0.5), (1.0, -1.05)):
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        for step in (in_python, in_engine):
            moved = step(wavy, wavy.layout.usual_inputs | inputs | {"elevation": elevation}, state | {"z": z}, 0.2)
            other = step(rov, inputs, state | {"z": z + elevation}, 0.2)
            assert moved == pytest.approx(other | {"z": other["z"] - elevation}, rel=1e-12, abs=1e-12)


def test_a_righting_moment_aligns_with_what_a_plumb_line_shows() -> None:
    """In water that accelerates, a vehicle rests where gravity and -A together point straight down."""
    (theta,) = simulate(in_waves(HEAVY), [0.0, 300.0], {"z": 5.0, "A_N": 1.0}, ["theta"]).values[:, 0, -1]
    assert abs(theta) == pytest.approx(atan(1.0 / G), abs=2e-3)
    times = np.linspace(0.0, 10.0, 101)
    begin, record = {"z": 5.0, "u_1": 0.3}, ["u", "w", "p", "z"]
    down = simulate(in_waves(HEAVY), times, begin | {"A_D": 1.3}, record).values
    lighter = HEAVY.with_(W=HEAVY["W"] * (1.0 - 1.3 / G), B=HEAVY["B"] * (1.0 - 1.3 / G))
    np.testing.assert_allclose(
        down, simulate(lighter, times, {"z": 5.0, "u_1": 0.3}, ["u", "w", "p", "z"]).values, atol=1e-12
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('waves = true\ncurrent = "passes"\n', 'must be false with current = "passes"'),
        ("waves = 1\n", "true or false"),
    ],
)
def test_waves_that_no_vehicle_can_have_are_refused(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "rov.toml"
    file.write_text(text + SHIPPED["bluerov2"].read_text())
    with pytest.raises(VehicleFileError, match=reason):
        load_vehicle(file)


def test_a_vehicle_file_keeps_its_waves() -> None:
    file = SHIPPED["bluerov2"]
    layout = read_vehicle(file, vehicle_text(in_waves(BLUEROV2), file.parent).encode()).layout
    assert layout.waves
    assert [*layout.inputs][-5:] == ["V_D", "A_N", "A_E", "A_D", "elevation"]


def test_vehicles_in_waves_move_in_lanes_as_alone() -> None:
    rng, times = np.random.default_rng(3), np.linspace(0.0, 2.0, 41)
    given = {"z": rng.uniform(-0.3, 0.3, (9, 1)), "elevation": 0.3 * np.sin(2.0 * times)[None]}
    given |= {f"A_{direction}": rng.uniform(-2.0, 2.0, (9, 41)) for direction in "NED"}
    rov = in_waves(surfaced(SIX))
    one, other = (simulate(rov, times, given, vehicles=9, lanes=lanes).values for lanes in (True, False))
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("fmi", [pytest.param(2, marks=pytest.mark.long), 3])
def test_an_fmu_moves_as_the_engine(request: pytest.FixtureRequest, fmi: int) -> None:
    rov, rng = a_vehicle(in_waves(surfaced(SIX))), random.Random(4)
    fmu = WRAPPERS[fmi](request.getfixturevalue({2: "wavy_dir", 3: "wavy3_dir"}[fmi]))
    inputs = random_inputs(rng, rov) | {"A_N": 1.5, "A_E": -0.5, "A_D": 2.0, "elevation": 0.4}
    state = random_state(rng, rov) | {"z": -0.2, "eta": 1.0} | dict.fromkeys(QUATERNION[1:], 0.0)
    with fmu.instance() as instance:
        instance.start({**rov.coefficients, **inputs, **{k: x for k, x in state.items() if k not in QUATERNION}})
        assert instance.step(0.0, 0.05) == OK
        moved = dict(zip(state, instance.get(list(state)), strict=True))
    assert moved == in_engine(rov, inputs, state, 0.05)
