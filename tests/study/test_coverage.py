"""Predicted bands contain the motion of the true vehicle as often as they should.

The integrator in verification/references/pool.py simulates true vehicles and their tests in a pool, with the errors of
measurements: noise, some of it slow, errors of time stamps, the marks of scales and rulers, and numbers read off a
plot. `identify` makes a vehicle file of the tests, and a study predicts a manoeuvre that is not one of them. The band
from 2.5 to 97.5 % must contain the truth of 95 % of the vehicles at each time, and the page's band, from 5 to 95 %,
that of 90 %. Neither may be wider than necessary.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu import Results, run_study
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify
from rov_fmu.vehicle.vehicle import Vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.folders import FORCE, HEAD, MASS, SPEED, TAU
from tests.recordings import run, write_log
from tests.vehicles import VIDEORAY
from verification.references.pool import Array

Random = np.random.Generator
NOMINAL = {"a_t_rear": 42.9, "b_t_rear": 2.711, "a_d_u": 8.0, "b_d_u": 4.0}
PLANS = (
    ((0.0, 3.0), (0.3, 12.0), (0.0, 12.0), (0.6, 10.0), (0.0, 12.0)),
    ((0.0, 3.0), (0.45, 12.0), (0.2, 12.0), (0.0, 10.0), (0.7, 8.0), (0.0, 12.0)),
)
STILL = "\n[priors]\ncurrent = 0.0\n"
"""The water of the tank is still: a distance from runs ahead alone cannot tell a current from drag."""
OFF, TIMES = 8.0, (1.0, 2.0, 4.0, 8.0, 9.0, 10.0, 12.0, 16.0)
PLAN = f"""vehicle = "found.toml"
vary_from = "found.toml"
stop_time = 16.0
step = 0.5
runs = 512
seed = {{seed}}
[inputs]
u_l.steps = [[0.0, 0.5], [{OFF}, 0.0]]
u_r.steps = [[0.0, 0.5], [{OFF}, 0.0]]
[keep]
outputs = ["u", "x"]
every = 1.0
[figures]
stopping_distance = "x[-1] - at(x, {OFF})"
"""
"""The vehicle goes ahead at half thrust, and then stops without thrust."""
LEVELS = {95: (0.025, 0.975), 90: (0.05, 0.95)}
"""The quantiles of each band, by the share of the runs within it (%)."""


def a_vehicle(random: Random) -> Vehicle:
    """Return a VideoRay with coefficients that differ by a quarter, and any β that a body in water may have."""
    off = {name: value * np.exp(0.25 * random.standard_normal()) for name, value in NOMINAL.items()}
    return VIDEORAY.with_(**{**off, "alpha_u": 1.0, "beta_u": random.uniform(0.5, 1.0)})


def pulls(folder: Path, k: Vehicle, random: Random) -> None:
    """Write 16 forces with errors of 0.3 N, read from a scale with marks of 0.1 N."""
    c = np.tile(np.linspace(0.1, 0.8, 8), 2)
    force = np.round(k["a_t_rear"] * c**2 + k["b_t_rear"] * c + 0.3 * random.standard_normal(16), 1)
    rows = [f"{command:.2f},{newton}" for command, newton in zip(c.tolist(), force.tolist(), strict=True)]
    (folder / "thrust_rear.csv").write_text("\n".join([FORCE, *rows]) + "\n", encoding="utf-8")


def recordings(folder: Path, k: Vehicle, random: Random) -> None:
    """Write two logs of the distance at 10 Hz: correlated errors of 2 cm, rounded to cm; time stamps with 5 ms."""
    for number, plan in enumerate(PLANS):
        found = run(k, SURGE, plan, 10.0).noisy(random, "distance", colour=0.5, jitter=0.005)
        write_log(folder, str(number), replace(found, values=np.round(found.values, 2)))


def points(folder: Path, k: Vehicle, random: Random) -> None:
    """Write V_ss and Tau of six steps from rest, with errors of 3 % and 5 %, read to the hundredth."""
    tables: dict[str, list[str]] = {SPEED: [], TAU: []}
    for command in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7):
        step = run(k, SURGE, ((command, 20.0),), 20.0)
        u = step.velocity * (1.0 + 0.03 * random.standard_normal()) + 0.02 * random.standard_normal(len(step.time))
        V_ss = u[-100:].mean()
        smooth = np.convolve(u, np.ones(5) / 5.0, "same")
        Tau = step.time[np.argmax(smooth >= (1.0 - np.exp(-1.0)) * V_ss)] * (1.0 + 0.05 * random.standard_normal())
        tables[SPEED].append(f"{command},{V_ss:.2f}")
        tables[TAU].append(f"{command},{Tau:.2f}")
    for name, (header, rows) in zip(("steady_surge", "time_constant_surge"), tables.items(), strict=True):
        (folder / f"{name}.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")


KINDS: dict[str, Callable[[Path, Vehicle, Random], None]] = {"recordings": recordings, "points": points}


def true_motion(k: Vehicle) -> dict[str, Array]:
    """Return u and x at the times, and the stopping distance."""
    motion = run(k, SURGE, ((0.5, OFF), (0.0, OFF + 0.2)), 10.0)
    rows = [round(10.0 * time) for time in TIMES]
    u, x = motion.velocity[rows], motion.position[rows]
    return {"u": u, "x": x, "stopping_distance": x[-1:] - x[TIMES.index(OFF)]}


@pytest.mark.parametrize(
    ("kind", "vehicles", "width"),
    [
        pytest.param("points", 60, 0.4, marks=pytest.mark.weekly),
        pytest.param("recordings", 15, 0.1, marks=pytest.mark.weekly),
    ],
)
def test_bands_hold_what_is_true(kind: str, vehicles: int, width: float, scheduler: str, tmp_path: Path) -> None:
    """`width` is the largest relative width of the band of the stopping distance.

    It is 7 % after two logs: when the logger's rows take effect is known to some 0.03 s, and with it the inertia. It is
    34 % after six steady speeds with errors of 3 %, which hardly tell the power of drag.

    docs/many-runs.md gives the shares for more vehicles, which would take too long here.
    """
    widths = list[float]()
    inside = {(level, of): list[float]() for level in LEVELS for of in ("u", "x", "stopping_distance")}
    for seed in range(vehicles):
        random, folder = np.random.default_rng([seed, len(kind)]), tmp_path / str(seed)
        k = a_vehicle(random)
        (folder / "tests").mkdir(parents=True)
        (folder / "tests" / "rov.toml").write_text(f"{HEAD}[known]\n{MASS}{STILL}", encoding="utf-8")
        pulls(folder / "tests", k, random)
        KINDS[kind](folder / "tests", k, random)
        found = identify(load_tests(folder / "tests")).vehicle
        write_vehicle(found, folder / "found.toml")
        (folder / "plan.toml").write_text(PLAN.format(seed=seed), encoding="utf-8")
        results = run_study(folder / "plan.toml", folder / "results", scheduler=scheduler)
        assert results.warnings == ()
        for of, true in true_motion(k).items():
            for level, quantiles in LEVELS.items():
                low, high = band(results, of, quantiles)
                inside[level, of].append(float(np.mean((low <= true) & (true <= high))))
        ends = results.runs.stopping_distance.quantile([*LEVELS[95], 0.5])
        widths.append(float((ends[0.975] - ends[0.025]) / ends[0.5]))
    shares = {key: 100.0 * float(np.mean(found)) for key, found in inside.items()}
    found_shares = ", ".join(f"{of} {level} %: {share:.1f} %" for (level, of), share in shares.items())
    print(f"{kind}: {found_shares}; width {np.median(widths):.3f}")
    for (level, _), share in shares.items():
        by_chance = 300.0 * np.sqrt(level / 100.0 * (1.0 - level / 100.0) / vehicles)  # three standard deviations
        assert share >= level - 5.0 - by_chance, found_shares
    assert np.median(widths) < width, found_shares


def band(results: Results, of: str, quantiles: tuple[float, float]) -> Array:
    """Return the lower and the upper limits of the band of an output at each time, or of a figure."""
    if of in results.figures:
        return np.asarray(results.runs[of].quantile([*quantiles]), np.float64)[:, None]
    return np.asarray(results.bands(of, quantiles).loc[[*TIMES]], np.float64).T
