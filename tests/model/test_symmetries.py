"""Laws that steps of a whole vehicle obey, in Python and in the FMU, tested without a reference."""

import random
from collections.abc import Callable
from functools import partial
from math import cos, hypot, sin, ulp

import pytest
from hypothesis import strategies as st

from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.fmi2 import Fmu
from tests.model.steps import Step, in_fmu, in_python
from tests.motions import DISTANCE, TINY, VELOCITY, hold, memory, path_of, power, signed, size
from tests.vehicles import EVERYTHING, HEAVY, VEHICLES, VIDEORAY, Case, State, Values, at_rest, random_case, still
from verification.references.closed_form import axes

POSITION = 1e-14  # the error that test_exactness.py allows, relative to the path

# ---- Vehicles, inputs and states ----

STILL = Rov(VIDEORAY.layout, {**dict.fromkeys(VIDEORAY.coefficients, 1.0), "a_d_u": 0.0, "b_d_u": 0.0})
PURE, SIGNED = size(-3.0, 2.0), signed(-3.0, 2.0)


@st.composite
def rov_cases(draw: st.DrawFn) -> Case:
    """Draw steps of the VideoRay with commands, loads and current."""
    commands = [draw(signed(-1.0, 0.1)) for _ in range(3)]
    loads, state = ([draw(signed(-3.0, 1.0)) for _ in range(number)] for number in (5, 7))
    inputs = dict(zip(VIDEORAY.layout.inputs, [*commands, *loads], strict=True))
    return VIDEORAY, inputs, dict(zip(VIDEORAY.layout.state, state, strict=True)), draw(power(-3.0, 3.0))


@st.composite
def bare_cases(draw: st.DrawFn) -> Case:
    """Draw steps of axes with any drag under loads alone. All sizes matter; the vehicle turns up to 1,000 rad."""
    h, V, turn = draw(power(-3.0, 3.0)), draw(power(-1.0, 2.0)), draw(power(-3.0, 1.0))
    drag: dict[str, float] = {}
    forces, velocities = [], []
    for name, speed in (("u", V), ("w", V), ("r", turn / h)):
        drag |= {f"a_d_{name}": draw(PURE) / (speed * h), f"b_d_{name}": draw(PURE) / h}
        forces.append(draw(SIGNED) * speed / h)
        velocities.append(draw(SIGNED) * speed)
    pose = [draw(SIGNED) * V * h for _ in "xyz"]
    current = [draw(SIGNED) * V for _ in "NE"]
    assert all(value <= STILL.layout.coefficients[name].maximum for name, value in drag.items())
    state = [*velocities, *pose, draw(st.floats(-10.0, 10.0))]
    inputs = dict(zip(VIDEORAY.layout.inputs, [0.0, 0.0, 0.0, *forces, *current], strict=True))
    return STILL.replaced(drag), inputs, dict(zip(VIDEORAY.layout.state, state, strict=True)), h


CASES = rov_cases() | bare_cases()


@pytest.fixture(params=["Python", "C"])
def step(request: pytest.FixtureRequest) -> Step:
    return in_python if request.param == "Python" else partial(in_fmu, request.getfixturevalue("fmu"))


def negated(values: Values, *names: str) -> State:
    return {name: -value if name in names else value for name, value in values.items()}


def for_every(law: Callable[[Step, Case], None]) -> Callable[[Step, int], None]:
    """Make a test of a law, with many more cases in the long and weekly tests."""

    @pytest.mark.parametrize(
        "cases", [20, pytest.param(150, marks=pytest.mark.long), pytest.param(500, marks=pytest.mark.weekly)]
    )
    def test(step: Step, cases: int) -> None:
        hold(lambda case: law(step, case), cases, CASES)

    test.__doc__ = law.__doc__
    return test


# ---- Mirror images, to the last bit ----


@for_every
def test_port_and_starboard_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    k, i, s, h = case
    inputs = negated({**i, "u_l": i["u_r"], "u_r": i["u_l"]}, "N_ext", "V_E")
    assert step(k, inputs, negated(s, "r", "y", "psi"), h) == negated(step(*case), "r", "y", "psi")


@for_every
def test_up_and_down_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    k, i, s, h = case
    assert step(k, negated(i, "u_t", "Z_ext"), negated(s, "w", "z"), h) == negated(step(*case), "w", "z")


@for_every
def test_ahead_and_astern_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    """In the mirror image, each rear thruster does the opposite of the other one, so their torque is the same."""
    k, i, s, h = case
    inputs = negated({**i, "u_l": -i["u_r"], "u_r": -i["u_l"]}, "X_ext", "V_N", "V_E")
    assert step(k, inputs, negated(s, "u", "x", "y"), h) == negated(step(*case), "u", "x", "y")


_TWINS = {"1": "2", "2": "1", "3": "4", "4": "3", "5": "6", "6": "5", "7": "8", "8": "7"}
"""The Heavy's thruster on the other side of each."""


@pytest.mark.parametrize("kind", ["Python", "C"])
def test_port_and_starboard_of_the_heavy_are_mirror_images(request: pytest.FixtureRequest, kind: str) -> None:
    """This includes sway, lag and coupling. Rounding differs, because the order of the thrusters in sums differs."""
    step = in_python if kind == "Python" else partial(in_fmu, Fmu(request.getfixturevalue("heavy_dir")))

    def mirrored(values: Values) -> State:
        swapped = {}
        for name, value in values.items():
            head, _, thruster = name.partition("_")
            swapped[f"{head}_{_TWINS[thruster]}" if thruster in _TWINS else name] = value
        return negated(swapped, "v", "r", "y", "psi", "Y_ext", "N_ext", "V_E")

    rng = random.Random(11)
    for _ in range(10):
        rov, inputs, before, h = random_case(rng, HEAVY)
        after = mirrored(step(rov, inputs, before, h))
        found = step(rov, mirrored(inputs), mirrored(before), h)
        assert found == pytest.approx(after, rel=1e-13, abs=1e-14)


# ---- Without force ----


@for_every
def test_without_force_no_velocity_gains_one_bit_or_changes_its_sign(step: Step, case: Case) -> None:
    k, i, s, h = case
    after = step(k, {**still(k), "V_N": i["V_N"], "V_E": i["V_E"]}, s, h)
    for name in ("u", "w", "r"):
        assert 0.0 <= after[name] <= s[name] or s[name] <= after[name] <= 0.0
        if k[f"a_d_{name}"] == k[f"b_d_{name}"] == 0.0:
            assert after[name] == s[name]


def energy(rov: Rov, state: Values) -> float:
    """Return the kinetic energy with the effective inertias."""
    return 0.5 * sum(rov.effective_inertia(form) * state[form.axis.velocity] ** 2 for form in rov.layout.axes)


@pytest.mark.parametrize("vehicle", [name for name, rov in VEHICLES.items() if rov.layout.coupled])
def test_without_thrust_and_load_energy_only_falls(vehicle: str) -> None:
    rov = VEHICLES[vehicle].replaced({n: 0.0 for n in VEHICLES[vehicle].coefficients if n.startswith("F_0")})
    rng = random.Random(vehicle)
    for _ in range(10):
        _, _, state, h = random_case(rng, rov, -2.0, 0.0)
        state |= dict.fromkeys(rov.layout.lagging, 0.0)
        after = rov.step(still(rov), state, h)
        assert energy(rov, after) <= energy(rov, state) * (1.0 + 1e-15)
        assert energy(rov, rov.step(still(rov), after, h)) <= energy(rov, after) * (1.0 + 1e-15)


def test_coupling_does_no_work() -> None:
    """Without drag, the energy is constant, and (M_u u)^2 + (M_v v)^2 is an invariant of Kirchhoff's equations."""
    rov = HEAVY.replaced({name: 0.0 for name in HEAVY.coefficients if name.startswith(("a_d", "b_d", "F_0"))})
    M_u, M_v = (rov.effective_inertia(rov.layout.kinds[name]) for name in ("surge", "sway"))
    rng = random.Random(12)
    for _ in range(10):
        _, _, state, h = random_case(rng, rov, -2.0, 0.5)
        state |= dict.fromkeys(rov.layout.lagging, 0.0)
        after = rov.step(still(rov), state, h)
        assert energy(rov, after) == pytest.approx(energy(rov, state), rel=1e-14)
        momenta = [hypot(M_u * s["u"], M_v * s["v"]) for s in (state, after)]
        assert momenta[1] == pytest.approx(momenta[0], rel=1e-14)


# ---- The same anywhere, in any direction ----


def drift(i: Values, h: float) -> float:
    return hypot(i["V_N"], i["V_E"]) * h


@for_every
def test_a_step_is_the_same_wherever_it_begins(step: Step, case: Case) -> None:
    k, i, s, h = case
    origin = {"x": 0.0, "y": 0.0, "z": 0.0}
    here, there = step(k, i, {**s, **origin}, h), step(*case)
    assert {**there, **origin} == {**here, **origin}
    for name in origin:
        start, end, moved = (state[name] for state in (s, there, here))
        # half a unit in the last place for each of two sums, in both steps
        largest = max(abs(start), abs(end), abs(moved), drift(i, h))
        assert abs(end - (start + moved)) <= 3.0 * ulp(largest)


@for_every
def test_a_step_is_the_same_in_every_direction(step: Step, case: Case) -> None:
    """The path turns with the heading, and with its rounding error. The angle within the step stays the same."""
    k, i, s, h = case
    turned = 2.0
    c, d = cos(turned), sin(turned)
    calm, origin = {**i, "V_N": 0.0, "V_E": 0.0}, {**s, "x": 0.0, "y": 0.0}
    a = step(k, calm, origin, h)
    b = step(k, calm, {**origin, "psi": s["psi"] + turned}, h)
    for name in "uwr":  # the heading is a part of the series, so the pieces of a step may differ
        assert abs(a[name] - b[name]) <= 3.0 * VELOCITY * max(abs(s[name]), abs(a[name])) + TINY
    assert b["z"] == pytest.approx(a["z"], rel=1e-14)
    assert abs(b["psi"] - (a["psi"] + turned)) <= 40.0 * ulp(abs(s["psi"]) + abs(a["psi"]) + turned)
    length = path_of(axes(k, i)[0], s["u"], h)
    allowed = length * (ulp(abs(s["psi"]) + turned) + 4e-13) + TINY
    assert abs(b["x"] - (a["x"] * c - a["y"] * d)) <= allowed
    assert abs(b["y"] - (a["x"] * d + a["y"] * c)) <= allowed


@pytest.mark.parametrize("exponent", [-900, -700, -300, 300])
def test_without_quadratic_drag_a_slow_vehicle_draws_the_path_of_a_fast_one(step: Step, exponent: int) -> None:
    """The paths agree to the last bit, because the scales are powers of two. Surge reverses while the vehicle turns."""
    scale = 2.0**exponent
    k = STILL.replaced({"b_d_u": 0.5})
    for X_ext, u in ((-1.0, 1.0), (1.0, -0.25), (0.5, 0.0), (0.0, 1.0)):
        start = {**at_rest(k), "r": 1.0}
        fast = step(k, {**still(k), "X_ext": X_ext}, {**start, "u": u}, 2.0)
        slow = step(k, {**still(k), "X_ext": X_ext * scale}, {**start, "u": u * scale}, 2.0)
        assert slow == {**fast, **{name: fast[name] * scale for name in ("u", "x", "y")}}


# ---- Semigroup ----


@pytest.mark.parametrize(
    "cases", [10, pytest.param(60, marks=pytest.mark.long), pytest.param(200, marks=pytest.mark.weekly)]
)
@pytest.mark.parametrize(("folder", "rov"), [("heavy_dir", HEAVY), ("everything_dir", load_vehicle(EVERYTHING).rov)])
def test_parts_of_a_step_of_coupled_vehicles_are_the_step(
    request: pytest.FixtureRequest, folder: str, rov: Rov, cases: int
) -> None:
    """The parts have any length. The rounding error between them fades or adds up over the time."""
    fmu, rng = Fmu(request.getfixturevalue(folder)), random.Random(13)
    for _ in range(cases):
        _, inputs, before, h = random_case(rng, rov, -4.0, 0.5)
        first = h * rng.uniform(0.1, 0.9)
        for step in (in_python, partial(in_fmu, fmu)):
            whole = step(rov, inputs, before, h)
            parts = step(rov, inputs, step(rov, inputs, before, first), h - first)
            assert parts == pytest.approx(whole, rel=1e-13, abs=1e-13)


@for_every
def test_two_half_steps_are_one_step(step: Step, case: Case) -> None:
    """The effect of rounding between them is derived for each axis, and for the position from surge and yaw."""
    k, i, s, h = case
    half = 0.5 * h
    once = step(*case)
    twice = step(k, i, step(k, i, s, half), half)
    passed_on, paths = {}, {}
    for name, axis in zip("uwr", axes(k, i), strict=True):
        rounding = VELOCITY * max(abs(s[name]), abs(once[name])) + TINY
        assert abs(twice[name] - once[name]) <= 3.0 * rounding
        passed_on[name] = rounding * memory(axis.A, axis.B, half)
        paths[name] = path_of(axis, s[name], h)
    depth = 2.0 * DISTANCE * paths["w"] + passed_on["w"] + 2.0 * ulp(abs(s["z"]) + paths["w"])
    assert abs(twice["z"] - once["z"]) <= depth
    heading = 2.0 * DISTANCE * paths["r"] + passed_on["r"] + 2.0 * ulp(abs(s["psi"]) + paths["r"])
    assert abs(twice["psi"] - once["psi"]) <= heading
    carried = drift(i, h)
    position = paths["u"] * (2.0 * POSITION + heading) + passed_on["u"]
    position += 3.0 * ulp(max(abs(s["x"]), abs(s["y"])) + paths["u"] + carried)
    assert abs(twice["x"] - once["x"]) <= position
    assert abs(twice["y"] - once["y"]) <= position
