"""The FMU's steps are exact: against models.dynamics, 50 digits, SciPy's integration of the equations, and itself."""

import random
from collections.abc import Mapping
from dataclasses import asdict, astuple, fields, replace
from functools import partial
from itertools import product
from math import copysign, cos, hypot, isfinite, pi, sin
from pathlib import Path
from time import process_time
from typing import Any

import pytest
from mpmath import mp
from scipy.integrate import solve_ivp

from checks import reference
from rov_fmu.motion import rov
from rov_fmu.motion.riccati import Riccati
from rov_fmu.motion.rov import Coefficients, Inputs, State
from rov_fmu.vehicle.vehicle import Vehicle
from tests.fmi2 import ERROR, OK, Fmu
from tests.motions import path_of

Case = tuple[Coefficients, Inputs, State, float]

STATES = [f.name for f in fields(State)]
VELOCITIES = ("u", "w", "r")
POSE = ("x", "y", "z", "psi")
ROUNDING = 2.0**-52


@pytest.fixture(scope="module")
def fmu(videoray_dir: Path) -> Fmu:
    return Fmu(videoray_dir)


def run(fmu: Fmu, k: Coefficients, i: Inputs, s: State, h: float, steps: int = 1) -> State:
    """The state of a new instance after equal steps that last h together."""
    with fmu.instance() as rov:
        rov.start({**asdict(k), **asdict(i), **asdict(s)})
        for n in range(steps):
            assert rov.step(n * h / steps, h / steps) == OK, rov.log
        return State(*rov.get(STATES))


# ---- Random vehicles, commands and steps ----


def random_case(rng: random.Random) -> Case:
    """A, B of (18) zero or 1e-4 ... 1e3, forces of 1e-4 ... 1e4 m/s2 by thrust, load or both, motions of any sign."""

    def size(low: float, high: float, zero: float = 0.0) -> float:
        return 0.0 if rng.random() < zero else float(10.0 ** rng.uniform(low, high))

    def signed(low: float, high: float, zero: float = 0.2) -> float:
        return rng.choice((-1.0, 1.0)) * size(low, high, zero)

    m, inertia = size(0, 2), size(-2, 1)
    beta_u, beta_w, beta_r = (size(-1, 1) for _ in range(3))
    u, w, r = ((effective * size(-4, 3, 0.15), effective * size(-4, 3, 0.15)) for effective in
               (m / beta_u, m / beta_w, inertia / beta_r))  # fmt: skip
    k = Coefficients(
        m_rov=m, I_r=inertia, R=size(-2, 0), gamma=rng.uniform(0.0, pi / 2),
        a_t_rear=signed(-2, 4), b_t_rear=signed(-2, 3), a_t_top=signed(-2, 4), b_t_top=signed(-2, 3),
        a_d_u=u[0], b_d_u=u[1], a_d_w=w[0], b_d_w=w[1], a_d_r=r[0], b_d_r=r[1],
        alpha_u=size(-1, 1), beta_u=beta_u, alpha_w=size(-1, 1), beta_w=beta_w, alpha_r=size(-1, 1), beta_r=beta_r,
    )  # fmt: skip
    both = rng.uniform(-1.1, 1.1)
    commands = rng.choice([(0.0, 0.0), (both, both), (both, rng.uniform(-1.1, 1.1))])
    loads = (m / beta_u * signed(-4, 4, 0.5), m / beta_w * signed(-4, 4, 0.5), inertia / beta_r * signed(-4, 4, 0.5))
    inputs = Inputs(*commands, rng.uniform(-1.1, 1.1), *loads, signed(-2, 1), signed(-2, 1))
    state = State(*(signed(-2, 2) for _ in VELOCITIES), *(signed(-1, 3) for _ in range(4)))
    return k, inputs, state, size(-5, 3)


def worst(found: State, expected: Mapping[str, Any], scales: Mapping[str, Any], before: State) -> tuple[float, float]:
    """Largest error of the velocities and of the pose, beyond the rounding of a pose that is far from zero."""
    relative = {}
    for name in STATES:
        error = abs(getattr(found, name) - expected[name])
        if name not in VELOCITIES:
            error = max(0.0, error - 2.0 * ROUNDING * abs(getattr(before, name)))
        relative[name] = float(error / scales[name]) if scales[name] else float(error)
    return max(relative[name] for name in VELOCITIES), max(relative[name] for name in POSE)


@pytest.mark.parametrize(("seed", "cases"), [(1, 1000), pytest.param(2, 20_000, marks=pytest.mark.long)])
def test_the_fmu_steps_as_the_python_model_does(fmu: Fmu, seed: int, cases: int) -> None:
    """Over 20,000 cases the velocities are equal and poses differ by 1e-16: the libraries' exp, sin and the like."""
    rng = random.Random(seed)
    for _ in range(cases):
        k, i, before, h = case = random_case(rng)
        expected = rov.step(*case)
        surge, heave, yaw = rov.axes(k, i)
        way = path_of(surge, before.u, h) + hypot(i.V_N, i.V_E) * h
        scales = {v: max(abs(getattr(before, v)), abs(getattr(expected, v))) for v in VELOCITIES}
        scales |= {"x": way, "y": way, "z": path_of(heave, before.w, h), "psi": path_of(yaw, before.r, h)}
        assert max(worst(run(fmu, *case), asdict(expected), scales, before)) <= 1e-14, case


@pytest.mark.parametrize(("seed", "cases"), [(3, 50), pytest.param(4, 400, marks=pytest.mark.long)])
def test_a_step_is_exact_over_random_vehicles_and_motions(fmu: Fmu, seed: int, cases: int) -> None:
    """What is left is that of the forces, where load and thrust or the terms of (9) nearly cancel."""
    rng = random.Random(seed)
    for _ in range(cases):
        case = random_case(rng)
        exact = reference.step(*case)
        velocity, pose = worst(run(fmu, *case), exact.state, exact.scale, case[2])
        assert velocity <= 1e-12, case
        assert pose <= 1e-12, case


def test_extreme_vehicles_are_exact(fmu: Fmu, vehicle: Vehicle) -> None:
    """A gram of mass and as much drag as a vehicle file may hold: up to 1e12/m and 1e12/s."""
    light = replace(vehicle.coefficients, m_rov=1e-3, beta_w=1e3)
    drags, loads = (0.0, 1.0, 1e6), (-1e12, -1.0, 0.0, 1e9)
    for a_d, b_d, Z_ext, w, h in product(drags, drags, loads, (0.0, 1.0, 1e6), (1e-5, 1.0, 1e3)):
        k, i = replace(light, a_d_w=a_d, b_d_w=b_d), Inputs(Z_ext=Z_ext)
        found, heave = run(fmu, k, i, State(w=w), h), rov.axes(k, i)[1]
        exact = reference.axis(heave.A, heave.B, heave.C, w, h)
        assert abs(found.w - exact.velocity) <= 2e-15 * exact.scale, (heave, w, h)
        assert abs(found.z - exact.distance) <= 4e-15 * exact.path, (heave, w, h)


# Axes of surge and yaw, u, r. Surge turns about, where its third derivative jumps, while the vehicle turns so fast
# that the shortcut for fast turns starts and ends there; rounding may leave the stop on either side of it.
REVERSALS = [
    *((Riccati(1.0, 0.0, 0.01), Riccati(0.0, 1.0, r), -0.01, r) for r in (20.0, 50.0, 70.0, 100.0, 150.0, 300.0)),
    (Riccati(0.144, 1e-4, 0.39), Riccati(0.104, 0.0, -9173.0), -2.16, -0.87),
    (Riccati(0.122, 0.15, 0.11), Riccati(0.085, 0.074, 7886.0), -1.07, 80.9),
    (Riccati(1.35, 0.3, 0.11), Riccati(0.0079, 0.9, 2407.0), -5.84, 10.7),
    (Riccati(4.16, 0.09, 0.425), Riccati(8.7e-4, 1.3, 9785.0), -1.11, 6.9),
]


def turning_case(surge: Riccati, yaw: Riccati, u: float, r: float, h: float) -> Case:
    ones = Coefficients(*[1.0] * len(fields(Coefficients)))
    k = replace(ones, a_d_u=surge.A, b_d_u=surge.B, a_d_r=yaw.A, b_d_r=yaw.B)
    return k, Inputs(X_ext=surge.C, N_ext=yaw.C), State(u=u, r=r), h


@pytest.mark.parametrize("after", [0.9, 1.0, 1.3, 2.5])
@pytest.mark.parametrize(("surge", "yaw", "u", "r"), REVERSALS)
def test_turning_about_while_spinning_is_exact(
    fmu: Fmu, surge: Riccati, yaw: Riccati, u: float, r: float, after: float
) -> None:
    k, i, before, h = turning_case(surge, yaw, u, r, after * surge.turning_time(u))
    exact = reference.step(k, i, before, h)
    for found in (run(fmu, k, i, before, h), rov.step(k, i, before, h)):
        assert max(worst(found, exact.state, exact.scale, before)) <= 1e-14


@pytest.mark.parametrize("A", [1e-12, 1e-6, 1e-3, 4.9e-3, 0.01, 0.3, 3.0])
@pytest.mark.parametrize("r", [-1.0, 1e6, 1e18])
@pytest.mark.parametrize("h", [0.01, 1.0, 1e3, 1e12])
def test_a_spin_that_drag_slows_down_is_exact(fmu: Fmu, A: float, r: float, h: float) -> None:
    """With a steady u, and A alone in yaw: x + iy = u ((1 + A r h)^(1 + i/A) - 1)/(r (A + i)), whatever it turns."""
    case = turning_case(Riccati(0.0, 2.0, 1.0), Riccati(A, 0.0, 0.0), 0.5, r, h)
    with mp.workdps(60):
        growth = 1 + mp.mpf(A) * abs(r) * h
        turn = mp.log(growth) / A
        exact = (growth * mp.expj(turn) - 1) / (2 * abs(r) * mp.mpc(A, 1))
        size = min(h, growth / abs(r)) / 2
        for found in (run(fmu, *case), rov.step(*case)):
            # the direction cannot be better than the rounding of the turn
            assert abs(mp.mpc(found.x, copysign(found.y, r * found.y)) - exact) <= size * 2e-15 * (1 + turn)
            assert abs(abs(found.psi) - turn) <= 4e-16 * turn


# As above, and h: turns in which something is huge, next to nothing, or both. The fuzzer found them.
FAR = {
    "drag takes all but a millionth of a spin": (
        Riccati(1e-12, 30.0, -1e-19),
        Riccati(1.9e-12, 1.1, 0.0),
        0.1,
        3e18,
        1.0,
    ),
    "a spin fades evenly": (Riccati(1e-12, 30.0, -1e-19), Riccati(0.0, 1.14, 0.0), 0.09, 2.7e18, 1.0),
    "a vehicle without drag to speak of": (
        Riccati(0.042, 0.7, 4.5),
        Riccati(1.2e-12, 1e-12, 2.4e-11),
        0.0,
        4e12,
        500.0,
    ),
    "a steady turn longer than the age of the universe": (
        Riccati(0.5, 1.4, 0.27),
        Riccati(0.14, 0.12, 5.2),
        0.0,
        1e9,
        1e24,
    ),
    "no surge but the smallest number": (Riccati(0.5, 1.4, 0.0), Riccati(0.14, 0.12, 1e-3), -5e-324, 0.0, 1e9),
    "a subnormal force": (Riccati(0.5, 152.0, -1e-311), Riccati(0.14, 0.12, -1e-12), 0.0, 0.0, 500.0),
    "a torque on a turn that is next to nothing": (
        Riccati(0.0, 1e-190, -1e-160),
        Riccati(0.0, 0.0, 1.5e9),
        0.0,
        5e-27,
        1e15,
    ),
    "surge fades as slowly as it turns": (Riccati(0.22, 0.0, 0.0), Riccati(1e-30, 1.14, 4e-25), 1.7e5, -7e-11, 4e29),
    "a surge to the fifth power overflows": (Riccati(0.5, 1.4, 0.0), Riccati(0.1, 0.0, -1e130), -1e66, -2e65, 0.5),
}


@pytest.mark.parametrize("name", FAR)
def test_no_turn_goes_too_far(fmu: Fmu, name: str) -> None:
    k, i, before, h = case = turning_case(*FAR[name])
    start = process_time()
    found = run(fmu, *case)
    assert process_time() - start < 0.1  # it takes at most some thousand pieces
    assert all(map(isfinite, astuple(found)))
    expected = rov.step(*case)
    assert [getattr(found, v) for v in VELOCITIES] == [getattr(expected, v) for v in VELOCITIES]
    assert abs(found.psi - expected.psi) <= 4.0 * ROUNDING * abs(expected.psi)
    way = path_of(rov.axes(k, i)[0], before.u, h)
    assert hypot(found.x, found.y) <= way * (1.0 + 1e-14) + 1e-320
    off = hypot(found.x - expected.x, found.y - expected.y)
    assert off <= way * (1e-14 + 4.0 * ROUNDING * abs(expected.psi)) + 1e-320


def test_what_overflows_is_said_at_once(fmu: Fmu) -> None:
    """Turns of more than 1e308 rad, and ways of more than 1e308 m."""
    calm = Riccati(0.5, 1.4, 0.27)
    for surge, yaw, u, r, h in [
        (calm, Riccati(0.14, 0.12, 5.2), 0.0, 1e9, 1.79e308),
        (calm, Riccati(0.0055, 0.0, 0.0), 0.0, 1.7e308, 1e308),
        (Riccati(0.0, 0.0, 1e300), calm, 0.0, 1.0, 1e8),
        (Riccati(0.0, 0.0, -1.0), Riccati(0.0, 0.0, 0.0), 1e10, 1e300, 1e10 + 10.0),
    ]:
        k, i, before, _ = case = turning_case(surge, yaw, u, r, h)
        assert not all(map(isfinite, astuple(rov.step(*case))))
        with fmu.instance() as instance:
            instance.start({**asdict(k), **asdict(i), **asdict(before)})
            start = process_time()
            assert instance.step(0.0, h) == ERROR
            assert process_time() - start < 0.1
            assert "overflows" in instance.log[-1].text


# ---- The VideoRay, against an integration of the equations as the paper prints them ----

AHEAD = Inputs(u_l=0.5, u_r=0.5)
AXES = {
    "ahead": (AHEAD, State()),
    "astern": (Inputs(u_l=-0.7, u_r=-0.7), State()),
    "reversing": (Inputs(u_l=-0.5, u_r=-0.5), State(u=1.2)),
    "turning": (Inputs(u_l=0.6, u_r=0.3), State(psi=1.0)),
    "turning back": (Inputs(u_l=0.3, u_r=0.6), State(u=0.8, r=1.5)),
    "spinning": (Inputs(u_l=0.7, u_r=-0.7), State(u=0.5)),
    "diving": (Inputs(u_t=0.7), State(w=-0.3, z=5.0)),
    "against loads": (Inputs(0.4, 0.2, -0.3, -3.0, 1.5, 0.1), State(u=0.5, w=0.2, r=-1.0)),
    "in a current": (replace(AHEAD, u_r=0.45, V_N=0.3, V_E=-0.8), State(x=10.0, y=-20.0, psi=-2.0)),
    "coasting": (Inputs(), State(u=1.5, w=-0.4, r=3.0)),
}


def integrated(k: Coefficients, i: Inputs, s: State, h: float) -> State:
    """(18), (2), (4) and the kinematics by DOP853."""
    F_l, F_r = ((k.a_t_rear * abs(c) * c + k.b_t_rear * c) / 2.0 for c in (i.u_l, i.u_r))  # half of (9) each
    F_t = k.a_t_top * abs(i.u_t) * i.u_t + k.b_t_top * i.u_t
    torque = F_l * k.R * sin(k.gamma) + F_r * k.R * sin(-k.gamma)

    def rates(_t: float, state: Any) -> list[float]:
        u, w, r, _x, _y, _z, psi = state
        return [
            k.beta_u * (k.alpha_u * (F_r + F_l) + i.X_ext - (k.a_d_u * u * abs(u) + k.b_d_u * u)) / k.m_rov,
            k.beta_w * (k.alpha_w * F_t + i.Z_ext - (k.a_d_w * w * abs(w) + k.b_d_w * w)) / k.m_rov,
            k.beta_r * (k.alpha_r * torque + i.N_ext - (k.a_d_r * r * abs(r) + k.b_d_r * r)) / k.I_r,
            u * cos(psi) + i.V_N,
            u * sin(psi) + i.V_E,
            w,
            r,
        ]

    solution = solve_ivp(rates, (0.0, h), astuple(s), method="DOP853", rtol=1e-12, atol=1e-12)
    return State(*solution.y[:, -1])


@pytest.mark.parametrize("h", [0.1, 1.0, 20.0])
@pytest.mark.parametrize("manoeuvre", AXES)
def test_a_step_solves_the_equations_of_the_paper(fmu: Fmu, vehicle: Vehicle, manoeuvre: str, h: float) -> None:
    inputs, before = AXES[manoeuvre]
    found, expected = (way(vehicle.coefficients, inputs, before, h) for way in (partial(run, fmu), integrated))
    assert astuple(found) == pytest.approx(astuple(expected), rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("manoeuvre", AXES)
def test_one_step_of_ten_seconds_is_a_thousand_of_ten_milliseconds(fmu: Fmu, vehicle: Vehicle, manoeuvre: str) -> None:
    inputs, before = AXES[manoeuvre]
    once = run(fmu, vehicle.coefficients, inputs, before, 10.0)
    often = run(fmu, vehicle.coefficients, inputs, before, 10.0, steps=1000)
    assert astuple(often)[:3] == pytest.approx(astuple(once)[:3], rel=1e-13, abs=1e-15)
    assert astuple(often)[3:] == pytest.approx(astuple(once)[3:], rel=1e-12, abs=1e-12)


# ---- Long steps and far headings ----


@pytest.mark.parametrize("manoeuvre", AXES)
def test_a_step_of_a_thousand_seconds_is_exact_and_takes_no_time(fmu: Fmu, vehicle: Vehicle, manoeuvre: str) -> None:
    inputs, before = AXES[manoeuvre]
    exact = reference.step(vehicle.coefficients, inputs, before, 1000.0)
    started = process_time()
    found = run(fmu, vehicle.coefficients, inputs, before, 1000.0)
    assert process_time() - started < 0.1  # some 0.1 ms, most of them not the step's
    assert max(worst(found, exact.state, exact.scale, before)) <= 1e-14


@pytest.mark.parametrize("psi", [1e3, -1e6, 1e9])
def test_a_heading_far_from_zero_is_as_good_as_one_near_it(fmu: Fmu, vehicle: Vehicle, psi: float) -> None:
    inputs = Inputs(u_l=0.6, u_r=0.3)
    near, far = (run(fmu, vehicle.coefficients, inputs, State(u=0.5, psi=start), 10.0) for start in (0.0, psi))
    assert (far.u, far.r) == (near.u, near.r)
    c, d = cos(psi), sin(psi)
    assert (far.x, far.y) == pytest.approx((near.x * c - near.y * d, near.x * d + near.y * c), rel=1e-13, abs=1e-15)
    assert far.psi == psi + near.psi


@pytest.mark.parametrize(("h", "steps"), [(1e6, 1), (1e6, 1000)])
def test_a_steady_turn_stays_on_its_circle(fmu: Fmu, vehicle: Vehicle, h: float, steps: int) -> None:
    inputs = Inputs(u_l=0.6, u_r=0.3)
    start = run(fmu, vehicle.coefficients, inputs, State(), 100.0)
    end = run(fmu, vehicle.coefficients, inputs, start, h, steps)
    assert (end.u, end.r) == pytest.approx((start.u, start.r), rel=1e-15)
    assert end.psi - start.psi == pytest.approx(start.r * h, rel=1e-13)
    radius = start.u / start.r
    centres = [(s.x - radius * sin(s.psi), s.y + radius * cos(s.psi)) for s in (start, end)]
    assert centres[1] == pytest.approx(centres[0], abs=1e-9 * radius)  # psi of 1e6 rad has 1e-10 rad of rounding
