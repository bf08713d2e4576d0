"""Buoyancy and thrust fade out above the surface, as in equations that are written by hand (docs/model.md)."""

import random
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.c.simulation import Array, simulate
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.equation.words import LEFT_WATER
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle, read_vehicle, without_surface
from rov_fmu.vehicle.writer import vehicle_text
from tests.equation.steps import in_engine, in_python
from tests.often import spread
from tests.vehicles import SIX, VIDEORAY, Values, at_rest, random_inputs, random_state, still, surfaced
from verification.references import rigid_body
from verification.references.rigid_body import Body
from verification.references.rigid_vehicle import body, compared, places

G = 9.80665
BLUEROV2 = without_surface(load_vehicle(SHIPPED["bluerov2"]))
LEVEL, TILTED = surfaced(BLUEROV2, 0.25), surfaced(SIX, 0.3)
ROVS = {"level, without W and B": LEVEL, "six axes, lag, loss with speed": TILTED}
"""The first has m_rov and F_0 alone, so that its weight is m_rov g and its buoyancy m_rov g - F_0."""
Z = 12
"""The place of the depth in a state of rigid_body.py."""


def at_share(held: Body, rov: Vehicle, share: float) -> Body:
    """Return a body of which only a share of the buoyancy and of the thrust is left."""
    left = replace(held, alpha=share * held.alpha, buoyancy=share * held.buoyancy)
    if "B" in rov.coefficients:
        return left
    lost = (1.0 - share) * (G * rov["m_rov"] - rov.coefficients.get("F_0_w", 0.0))
    return replace(left, load=held.load + lost * np.eye(6)[2])


def expected(rov: Vehicle, inputs: Values, state: Values, h: float) -> list[float]:
    """Return the state of the rigid body after h seconds.

    The coefficients of a piece are held, so that it is smooth. It ends where a velocity reverses, or where the vehicle
    passes the surface or the height above it.
    """
    held, H = body(rov, inputs), rov["height"]
    y, t = np.array(places(rov, state), float), 0.0
    boundaries: list[Callable[[Array], float]] = [lambda y, i=i: float(y[i]) for i in held.places]  # type: ignore[misc]
    boundaries += [lambda y: float(y[Z]), lambda y: float(y[Z]) + H]
    while t < h:
        later = y + 1e-9 * rigid_body.rates(at_share(held, rov, min(max(1.0 + y[Z] / H, 0.0), 1.0)), held.inverse, y)
        sides = [np.sign(of(y)) if abs(of(y)) > 1e-13 else np.sign(of(later)) for of in boundaries]
        signs = np.ones(6 + int(np.sum(held.lags != 0)), int)
        signs[held.places] = [-1 if side < 0 else 1 for side in sides[:-2]]
        below, above = sides[-2] >= 0, sides[-1] < 0

        def rate(_: float, y: Array, below: bool = below, above: bool = above, signs: Array = signs) -> Array:
            share = 1.0 if below else 0.0 if above else 1.0 + y[Z] / H
            return rigid_body.rates(at_share(held, rov, share), held.inverse, y, signs)

        events = []
        for of, side in zip(boundaries, sides, strict=True):

            def event(_: float, y: Array, of: Callable[[Array], float] = of, side: float = side) -> float:
                return side * of(y) + 1e-14

            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
            events.append(event)
        found = solve_ivp(rate, (t, h), y, "DOP853", events=events, rtol=3e-14, atol=1e-15)
        y, t = found.y[:, -1], float(found.t[-1])
    return compared(rov, y.tolist())


def near(rov: Vehicle, found: Values, exact: list[float], limit: float) -> None:
    for x, y in zip(compared(rov, places(rov, found)), exact, strict=True):
        assert abs(float(x) - y) <= limit * (1.0 + abs(y))


CASES = {"level, without W and B": ((1e-3, -1e-4, 0.5), (0.02, 0.01, -1.0), (6.0, 0.5, -2.0))}
CASES["six axes, lag, loss with speed"] = (1e-3, 1e-4, -0.5), (0.3, -0.1, -0.5), (1.2, 0.3, -1.6)


@pytest.mark.parametrize("name", spread(ROVS, [next(iter(ROVS))], ROVS))
def test_floating_jumping_out_and_diving_again_is_exact(name: str) -> None:
    rng, rov = random.Random(name), ROVS[name]
    for h, z, w in CASES[name]:
        inputs, state = random_inputs(rng, rov), random_state(rng, rov) | {"z": z, "w": w}
        if "eta" in state:  # nearly level, so that it leaves the water
            state |= dict(zip(("eta", "epsilon_1", "epsilon_2", "epsilon_3"), (0.99, 0.1, -0.05, 0.08), strict=True))
        inputs |= dict.fromkeys((name for name in inputs if name.endswith("_ext") or name.startswith("V_")), 0.0)
        exact = expected(rov, inputs, state, h)
        for step in (in_python, in_engine):
            near(rov, step(rov, inputs, state, h), exact, 1e-11)


def test_a_jump_passes_the_height_above_which_nothing_lifts() -> None:
    """There the vehicle falls with its weight, and commands have no effect."""
    start = {"z": 0.4, "w": -2.5}
    times = np.linspace(0.0, 2.0, 201)
    z, rate = simulate(LEVEL, times, start, ["z", "der(w)"]).values[:, 0]
    assert z.min() < -0.25
    assert z[-1] > z.min()
    falling = LEVEL.derivatives(still(LEVEL) | {"u_5": 1.0, "u_1": 1.0}, at_rest(LEVEL) | {"z": -1.0})
    assert falling["w"] * LEVEL.effective_inertia(HEAVE) == pytest.approx(G * LEVEL["m_rov"])
    assert falling["u"] == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(rate).all()


def test_in_the_air_thrust_that_is_lost_moves_nothing() -> None:
    """The thrust and what it loses cancel each other but for rounding errors, whose signs are no directions."""
    rng, rov = random.Random(1), LEVEL.with_(height=0.254)  # 1/H is no binary fraction
    for z in np.linspace(-15.0, -1.0, 20):
        state = at_rest(rov) | {"z": float(z), "w": 0.8, "r": rng.uniform(-2.0, 2.0)}
        state |= {name: rng.uniform(-20.0, 20.0) for name in rov.layout.lagging}
        inputs = still(rov) | {name: rng.uniform(-1.0, 1.0) for name in rov.layout.commands}
        for step in (in_python, in_engine):
            moved = step(rov, inputs, state, 1e-5)
            assert (moved["u"], moved["v"]) == pytest.approx((0.0, 0.0), abs=1e-17)


@pytest.mark.parametrize("name", ROVS)
def test_below_the_surface_it_moves_as_without_one(name: str) -> None:
    rov = ROVS[name]
    inputs = random_inputs(random.Random(1), rov)
    state = random_state(random.Random(2), rov) | {"z": 3.0}
    for h in (1e-3, 0.3):
        found, before = (step(one, inputs, state, h) for step in (in_engine,) for one in (rov, without_surface(rov)))
        assert found == pytest.approx(before, rel=1e-13, abs=1e-13)


def test_a_buoyant_vehicle_floats_and_a_neutral_one_stays_at_the_surface() -> None:
    level = {name: 0.0 for name in TILTED.coefficients if name.startswith(("F_0", "x_", "y_"))}
    buoyant = TILTED.with_(B=1.2 * TILTED["W"], **level)
    (z,) = simulate(buoyant, [0.0, 200.0], {"z": 1.0}, ["z"]).values[:, 0, -1]
    assert z == pytest.approx(-0.3 * (1.0 - 1.0 / 1.2), abs=1e-9)
    (z,) = simulate(LEVEL, [0.0, 200.0], {"z": 1.0}, ["z"]).values[:, 0, -1]
    assert z == pytest.approx(-0.25 * (1.0 - G * 11.5 / (G * 11.5 + 2.0)), abs=1e-9)
    neutral = LEVEL.with_(F_0_w=0.0)
    np.testing.assert_array_equal(simulate(neutral, [0.0, 10.0], {}, ["z", "w"]).values[:, 0, -1], 0.0)


def test_it_is_written_and_read_and_what_it_cannot_have_is_one_line() -> None:
    rov = load_vehicle(SHIPPED["bluerov2_heavy"])
    path, text = SHIPPED["bluerov2_heavy"], vehicle_text(rov, SHIPPED["bluerov2_heavy"].parent)
    height = '[surface]\nheight = {value = 0.2, unit = "m", source = "a drawing"}\n'
    text = text.partition("[surface]")[0] + text.partition("[surface]")[2].partition("\n\n")[2]
    read = read_vehicle(path, (text + height).encode())
    last = read.layout.variables[-1 - len(read.layout.added)]
    assert (read["height"], read.layout.surface, last) == (0.2, True, "height")
    assert read_vehicle(path, vehicle_text(read, path.parent).encode()) == read
    for added, words in (
        ("[surface]\n", "surface.height: this key is missing"),
        (height.replace("0.2", "0.0"), "surface.height.value = 0.0: must be "),
    ):
        with pytest.raises(VehicleFileError, match=words):
            read_vehicle(path, (text + added).encode())
    with pytest.raises(VehicleFileError, match=r"curves\.t200\.lag = 'speed': must be 'force' with a surface"):
        read_vehicle(path, (text.replace("[curves.t200]\n", '[curves.t200]\nlag = "speed"\n') + height).encode())
    assert not VIDEORAY.layout.surface


def test_a_vehicle_without_a_surface_is_told_to_leave_the_water(capsys: pytest.CaptureFixture[str]) -> None:
    """`simulate` says it once. A vehicle that stays below, and one that has a surface, get no such line."""
    words = f"rov-fmu: {LEFT_WATER.format(0.01)}"
    for depth, told in (("0", words), ("9", "")):
        assert main(["simulate", "videoray", "--set", "heave=-0.5", "--set", f"z={depth}", "--stop", "1"]) == 0
        assert " ".join(capsys.readouterr().err.split()) == told
    assert not LEVEL.layout.has_only_water
