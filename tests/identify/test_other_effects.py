"""Effects that no table of tank tests shows are found in logs whose equations are written out here."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import Identification, Interval
from tests.folders import ARM, HEAD, MASS, TURNS, folder_of
from tests.vehicles import VIDEORAY

THRUST = "".join(
    f'{key} = {{ value = {value}, unit = "N", source = "bollard pull" }}\n'
    for key, value in (("a_t_rear", 78.0), ("b_t_rear", 0.0))
)
HELD = (0.0, 0.3, 0.0, 0.6, 0.0, -0.4, 0.7, 0.0, -0.7, 0.5, 0.0, -0.3, 0.0, 0.8, 0.2)
"""Commands, each for 4 s."""


def contains(interval: Interval | None, truth: float) -> bool:
    return bool(interval and interval[0] <= truth <= interval[1])


def identified(folder: Path, rov: str, columns: Mapping[str, np.ndarray], name: str) -> Identification:
    rows = (",".join(f"{value:.6g}" for value in row) for row in zip(*columns.values(), strict=True))
    return identify(load_tests(folder_of(folder, rov, {name: "\n".join([",".join(columns), *rows])})))


@pytest.mark.long
@pytest.mark.parametrize("lost", [12.0, 0.0])
def test_thrust_that_falls_with_the_speed_is_found(lost: float, tmp_path: Path) -> None:
    """The thrust at rest is exact, 78 c |c| N. Of it, d |c| v is lost; the way to stop has no thrust."""
    h, speeds, v = 0.001, [], 0.0
    commands = np.repeat(HELD, round(4.0 / h))
    for c in commands.tolist():
        speeds.append(v)
        v += h * (78.0 * c * abs(c) - lost * abs(c) * v - 38.0 * abs(v) * v - 9.0 * v) / 31.0
    measured = np.array(speeds) + 0.01 * np.random.default_rng(1).standard_normal(len(speeds))
    time = h * np.arange(len(commands))
    columns = {"time [s]": time, "command [1]": commands, "velocity [m/s]": measured}
    mass = 'm_rov = { value = 20.0, unit = "kg", source = "scale" }\n'
    every = {title: values[::100] for title, values in columns.items()}
    found = identified(tmp_path, f"{HEAD}[known]\n{mass}{THRUST}", every, "log_surge.csv")
    (surge,) = found.axes
    truth = {"a_d_u": 38.0, "b_d_u": 9.0, "beta_u": 20.0 / 31.0}
    assert [one.name for one in surge.known if contains(one.interval, truth[one.name])] == [*truth]
    kept = {effect.kind: effect for effect in found.effects if effect.kept}
    assert ("advance" in kept) == ("d_rear" in found.vehicle.coefficients) == (lost > 0.0)
    if lost:
        assert contains(kept["advance"].interval, lost / 78.0)
        assert contains(found.vehicle.intervals["d_rear"], lost)
    for answer in surge.answers:
        c = abs(answer.command)
        V = 2.0 * 78.0 * c**2 / (9.0 + lost * c + np.hypot(9.0 + lost * c, np.sqrt(4.0 * 38.0 * 78.0) * c))
        way = 31.0 / 38.0 * np.log((38.0 * V + 9.0) / (3.8 * V + 9.0))
        assert contains(answer.stop[1], way), answer
        assert contains(answer.steady[1], np.copysign(V, answer.command)), answer


@pytest.mark.long
@pytest.mark.parametrize("aside", [0.3, 0.0])
def test_a_velocity_sensor_beside_the_origin_is_found(aside: float, tmp_path: Path) -> None:
    """A sensor to starboard measures u - r y."""
    random, step = np.random.default_rng(2), 0.1
    rov = VIDEORAY
    commands = {name: np.repeat(random.uniform(-0.5, 0.5, 30), 30) for name in ("u_l", "u_r")}
    time = step * np.arange(900.0)
    motion = simulate(rov, time, commands).values[:, 0]
    u, r = (motion[[*rov.layout.state].index(name)] for name in "ur")
    noise = 0.005 * random.standard_normal((2, len(time)))
    columns = {
        "time [s]": time,
        **{f"{name} [1]": values for name, values in commands.items()},
        "surge velocity [m/s]": u - aside * r + noise[0],
        "yaw velocity [rad/s]": r + noise[1],
    }
    thrust = "".join(
        f'{key} = {{ value = {rov[key]}, unit = "N", source = "bollard pull" }}\n' for key in ("a_t_rear", "b_t_rear")
    )
    found = identified(tmp_path, f"{HEAD}[known]\n{MASS}{TURNS}{ARM}{thrust}", columns, "dive.csv")
    kept = {effect.name: effect for effect in found.effects if effect.kept}
    assert ("place of the velocity sensor to starboard" in kept) == (aside > 0.0)
    if aside:
        assert contains(kept["place of the velocity sensor to starboard"].interval, aside)
    surge = next(result for result in found.axes if result.axis is SURGE)
    for answer in surge.answers:
        V, _ = rov.response(SURGE, answer.command)
        assert contains(answer.steady[1], V), answer
