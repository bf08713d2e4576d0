"""Laws of the whole vehicle, pose included: a step of models.dynamics and of the FMU, judged by itself."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from math import cos, hypot, sin, ulp

import pytest
from hypothesis import strategies as st

from rov_fmu.motion import rov
from rov_fmu.motion.rov import Coefficients, Inputs, State
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.fmi2 import Fmu
from tests.motion.test_exactness import Case, run
from tests.motions import DISTANCE, TINY, VELOCITY, hold, memory, path_of, power, signed, size

Step = Callable[[Coefficients, Inputs, State, float], State]

POSITION = 1e-14  # of the path: what test_exactness.py promises

# ---- Vehicles, inputs and states ----

ROV = load_vehicle(VIDEORAY).coefficients
STILL = replace(Coefficients(*[1.0] * len(fields(Coefficients))), a_d_u=0.0, b_d_u=0.0)
PURE, SIGNED = size(-3.0, 2.0), signed(-3.0, 2.0)


@st.composite
def rov_cases(draw: st.DrawFn) -> Case:
    """The VideoRay, with commands, loads and current."""
    commands = [draw(signed(-1.0, 0.1)) for _ in range(3)]
    loads, state = ([draw(signed(-3.0, 1.0)) for _ in range(number)] for number in (5, 7))
    return ROV, Inputs(*commands, *loads), State(*state), draw(power(-3.0, 3.0))


@st.composite
def bare_cases(draw: st.DrawFn) -> Case:
    """Axes of any drag under loads alone, each with sizes that matter within the step; up to 1,000 rad are turned."""
    h, V, turn = draw(power(-3.0, 3.0)), draw(power(-1.0, 2.0)), draw(power(-3.0, 1.0))
    drag: dict[str, float] = {}
    forces, velocities = [], []
    for name, speed in (("u", V), ("w", V), ("r", turn / h)):
        drag |= {f"a_d_{name}": draw(PURE) / (speed * h), f"b_d_{name}": draw(PURE) / h}
        forces.append(draw(SIGNED) * speed / h)
        velocities.append(draw(SIGNED) * speed)
    pose = [draw(SIGNED) * V * h for _ in "xyz"]
    current = [draw(SIGNED) * V for _ in "NE"]
    k = replace(STILL, **drag)
    assert all(value <= rov.COEFFICIENTS[name].maximum for name, value in drag.items())
    state = State(*[*velocities, *pose, draw(st.floats(-10.0, 10.0))])
    return k, Inputs(0.0, 0.0, 0.0, *forces, *current), state, h


CASES = rov_cases() | bare_cases()


@pytest.fixture(params=["model", "FMU"])
def step(request: pytest.FixtureRequest, fmu: Fmu) -> Step:
    return partial(run, fmu) if request.param == "FMU" else rov.step


def for_every(law: Callable[[Step, Case], None]) -> Callable[[Step, int], None]:
    """Make a law a test of some hundred cases, and of many more in the long run."""

    @pytest.mark.parametrize("cases", [100, pytest.param(500, marks=pytest.mark.long)])
    def test(step: Step, cases: int) -> None:
        hold(lambda case: law(step, case), cases, CASES)

    test.__doc__ = law.__doc__
    return test


# ---- Mirror images, to the last bit ----


@for_every
def test_port_and_starboard_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    k, i, s, h = case
    after = step(*case)
    inputs = replace(i, u_l=i.u_r, u_r=i.u_l, N_ext=-i.N_ext, V_E=-i.V_E)
    assert step(k, inputs, replace(s, r=-s.r, y=-s.y, psi=-s.psi), h) == replace(
        after, r=-after.r, y=-after.y, psi=-after.psi
    )


@for_every
def test_up_and_down_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    k, i, s, h = case
    after = step(*case)
    assert step(k, replace(i, u_t=-i.u_t, Z_ext=-i.Z_ext), replace(s, w=-s.w, z=-s.z), h) == replace(
        after, w=-after.w, z=-after.z
    )


@for_every
def test_ahead_and_astern_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    """Thrust of the rear pair reversed, its torque kept: each thruster does the opposite of the other."""
    k, i, s, h = case
    after = step(*case)
    inputs = replace(i, u_l=-i.u_r, u_r=-i.u_l, X_ext=-i.X_ext, V_N=-i.V_N, V_E=-i.V_E)
    assert step(k, inputs, replace(s, u=-s.u, x=-s.x, y=-s.y), h) == replace(after, u=-after.u, x=-after.x, y=-after.y)


# ---- Without force ----


@for_every
def test_without_force_no_velocity_gains_one_bit_or_changes_its_sign(step: Step, case: Case) -> None:
    k, i, s, h = case
    after = step(k, Inputs(V_N=i.V_N, V_E=i.V_E), s, h)
    for name in ("u", "w", "r"):
        first, last = getattr(s, name), getattr(after, name)
        assert 0.0 <= last <= first or first <= last <= 0.0
        if getattr(k, f"a_d_{name}") == getattr(k, f"b_d_{name}") == 0.0:
            assert last == first


# ---- The same anywhere, in any direction ----


def drift(i: Inputs, h: float) -> float:
    return hypot(i.V_N, i.V_E) * h


@for_every
def test_a_step_is_the_same_wherever_it_begins(step: Step, case: Case) -> None:
    k, i, s, h = case
    here, there = step(k, i, replace(s, x=0.0, y=0.0, z=0.0), h), step(*case)
    assert replace(there, x=0.0, y=0.0, z=0.0) == replace(here, x=0.0, y=0.0, z=0.0)
    for name in ("x", "y", "z"):
        start, end, moved = (getattr(state, name) for state in (s, there, here))
        # two sums, of which the current's is one: half a unit in the last place of each, here and there
        largest = max(abs(start), abs(end), abs(moved), drift(i, h))
        assert abs(end - (start + moved)) <= 3.0 * ulp(largest)


@for_every
def test_a_step_is_the_same_in_every_direction(step: Step, case: Case) -> None:
    """With the heading the path turns, by its rounding, too; the angle turned within the step stays."""
    k, i, s, h = case
    turned = 2.0
    c, d = cos(turned), sin(turned)
    still = replace(i, V_N=0.0, V_E=0.0)
    a = step(k, still, replace(s, x=0.0, y=0.0), h)
    b = step(k, still, replace(s, x=0.0, y=0.0, psi=s.psi + turned), h)
    assert replace(b, x=a.x, y=a.y, psi=a.psi) == a
    assert abs(b.psi - (a.psi + turned)) <= 2.0 * ulp(abs(s.psi) + abs(a.psi) + turned)
    length = path_of(rov.axes(k, i)[0], s.u, h)
    allowed = length * (ulp(abs(s.psi) + turned) + 8.0 * ulp(1.0)) + TINY
    assert abs(b.x - (a.x * c - a.y * d)) <= allowed
    assert abs(b.y - (a.x * d + a.y * c)) <= allowed


@pytest.mark.parametrize("exponent", [-900, -700, -300, 300])
def test_without_quadratic_drag_a_slow_vehicle_draws_the_path_of_a_fast_one(step: Step, exponent: int) -> None:
    """To the last bit, for sizes that are powers of two; as yaw turns, surge turns about."""
    scale = 2.0**exponent
    k = replace(STILL, b_d_u=0.5)
    for X_ext, u in ((-1.0, 1.0), (1.0, -0.25), (0.5, 0.0), (0.0, 1.0)):
        fast = step(k, Inputs(X_ext=X_ext), State(u=u, r=1.0), 2.0)
        slow = step(k, Inputs(X_ext=X_ext * scale), State(u=u * scale, r=1.0), 2.0)
        assert slow == replace(fast, u=fast.u * scale, x=fast.x * scale, y=fast.y * scale)


# ---- Semigroup ----


@for_every
def test_two_half_steps_are_one_step(step: Step, case: Case) -> None:
    """What the rounding of the state between them does is derived axis by axis, the position's from surge and yaw."""
    k, i, s, h = case
    half = 0.5 * h
    once = step(*case)
    middle = step(k, i, s, half)
    twice = step(k, i, middle, half)
    passed_on, ways = {}, {}
    for name, axis in zip("uwr", rov.axes(k, i), strict=True):
        first, last = getattr(s, name), getattr(once, name)
        rounding = VELOCITY * max(abs(first), abs(last)) + TINY
        assert abs(getattr(twice, name) - last) <= 3.0 * rounding
        passed_on[name] = rounding * memory(axis.A, axis.B, half)
        ways[name] = path_of(axis, first, h)
    depth = 2.0 * DISTANCE * ways["w"] + passed_on["w"] + 2.0 * ulp(abs(s.z) + ways["w"])
    assert abs(twice.z - once.z) <= depth
    heading = 2.0 * DISTANCE * ways["r"] + passed_on["r"] + 2.0 * ulp(abs(s.psi) + ways["r"])
    assert abs(twice.psi - once.psi) <= heading
    carried = drift(i, h)
    position = ways["u"] * (2.0 * POSITION + heading) + passed_on["u"]
    position += 3.0 * ulp(max(abs(s.x), abs(s.y)) + ways["u"] + carried)
    assert abs(twice.x - once.x) <= position
    assert abs(twice.y - once.y) <= position
