"""The figures that the tutorials quote are those of their data and of the simulated water that these come from.

A test that fails tells the rows as they are now.
"""

import re
from math import log
from pathlib import Path

import numpy as np
import pytest

from examples import hold_station
from examples.dive_log import CURRENT, LAG, bluerov2, dive, write_log
from examples.tank_tests import DELAY, OTTER, bollard_pull, write_tests
from rov_fmu import Results
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import Identification, IdentifiedEffect, coverage_of
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import REFIT, ROOT, Capsys
from tests.docs.test_docs import STOPPING, run, runnable
from tests.vehicles import at_rest, still
from verification.published import load_tables

TANK, DIVE = (ROOT / "docs" / f"tutorial-{name}.md" for name in ("tank-tests", "dive-log"))


@pytest.fixture(scope="module")
def otter(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    folder = tmp_path_factory.mktemp("otter")
    write_tests(folder)
    return identify(load_tests(folder))


@pytest.fixture(scope="module")
def harbour(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    folder = tmp_path_factory.mktemp("harbour")
    (rov_toml,) = re.findall(
        r"harbour/rov.toml <<END\n(.*?)^END$", DIVE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    (folder / "rov.toml").write_text(rov_toml, encoding="utf-8")
    write_log(folder / "log_dive.tlog", dive())
    return identify(load_tests(folder))


def text(page: Path) -> str:
    """A tutorial, with its lines joined."""
    return " ".join(page.read_text(encoding="utf-8").split())


def misses(found: Identification, truth: Vehicle) -> list[str]:
    """Return the coefficients whose interval does not contain the truth."""
    intervals = {name: of for name, of in found.vehicle.intervals.items() if name in truth.coefficients}
    return [name for name, (low, high) in intervals.items() if not low <= truth[name] <= high]


def kept(found: Identification) -> dict[str, IdentifiedEffect]:
    """What else acts, by its name."""
    return {effect.name: effect for effect in found.effects if effect.kept}


def check_trust(found: Identification) -> None:
    """Check that each axis is good, because its bands contain the data that was not fitted."""
    for axis in found.axes:
        assert axis.verdict.word == "good", axis.axis.name
        assert coverage_of(axis.predictions) > 0.9, axis.axis.name
        assert axis.main
        assert axis.main.error < axis.main.unchanged


@pytest.mark.weekly
def test_otter(otter: Identification) -> None:
    names = re.findall(r'"((?:a_d|b_d|beta|F_0)_[uwr])"', text(TANK))
    assert len(names) == 10
    assert len([name for name in misses(otter, OTTER) if name in names]) <= 1
    assert all(otter.vehicle[name] == pytest.approx(OTTER[name], rel=0.04) for name in names)
    found = {effect.kind: effect for effect in kept(otter).values()}
    assert {"dead time", "load"} <= found.keys()
    low, high = found["dead time"].interval
    assert low <= DELAY <= high
    assert high - low < 0.08, "short lags of the sensors may act in its place"
    assert found["load"].value == pytest.approx(OTTER["F_0_w"], abs=0.003)
    check_trust(otter)
    assert not by_heading(otter.findings)["Warnings"]
    assert not {"current", "drag astern"} & found.keys()
    ahead = OTTER.step(still(OTTER) | {"u_l": 0.5, "u_r": 0.5}, at_rest(OTTER), 10.0)["u"]
    assert f"Otter itself reaches {ahead:.3f} m/s" in text(TANK)
    ((command, scatter),) = re.findall(r"the forces at (\d+) % scatter by ([\d.]+) N", text(TANK))
    assert 1.0 < otter.vehicle.force(SURGE, float(command) / 100.0) < 5.0
    pulls = np.loadtxt(otter.folder.path / "thrust_rear.csv", delimiter=",", skiprows=1)
    off = [force - bollard_pull("rear", command / 100.0) for command, force in pulls.tolist()]
    assert np.std(off) == pytest.approx(float(scatter), rel=0.3)


@pytest.mark.weekly
def test_dive(harbour: Identification) -> None:
    """Of the intervals of 95 %, at most two miss the truth, and predictions stay inside their bands."""
    assert len(harbour.vehicle.intervals) >= 14
    assert len(misses(harbour, bluerov2())) <= 2
    found = kept(harbour)
    currents = [found[f"current to the {side}"].value for side in ("north", "east")]
    assert currents == pytest.approx(CURRENT, abs=0.003)
    check_trust(harbour)
    told, truth = text(DIVE), bluerov2()
    load = f"{truth['F_0_w']:g}".replace("-", "−")
    north, east = (f"{part:g}".replace("-", "−") for part in CURRENT)
    assert f"lag of {LAG:g} s, a load of {load} N in heave" in told
    assert f"a current of {north} m/s north and {east} m/s east" in told


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Results]:
    """The studies of the tutorial, by its commands."""
    folder = tmp_path_factory.mktemp("stopping")
    for block in runnable(STOPPING):
        run(folder, "bash", "-euc", block)
    return {name: Results(folder / name) for name in ("stop", "wall")}


@pytest.mark.long
def test_the_stopping_distance_is_as_uncertain_as_told(stopped: dict[str, Results]) -> None:
    expected = []
    for name in ("stop", "wall"):
        for figure, words in (("speed", "speed, m/s"), ("stopping_distance", "stopping distance, m")):
            low, middle, high = stopped[name].runs[figure].quantile([0.05, 0.5, 0.95])
            expected.append(f"| {words} | {low:.3g} | {middle:.3g} | {high:.3g} |")
    share = stopped["wall"].runs.beta_u.corr(stopped["wall"].runs.stopping_distance) ** 2
    expected.append(f"Their error and that of the drag cause {1.0 - share:.0%} of the variance".replace("%", " %"))
    expected.append(f"which causes {share:.0%} of the variance".replace("%", " %"))
    rov = load_vehicle(REFIT)
    a, b, inertia = rov["a_d_u"], rov["b_d_u"], rov["m_rov"] / rov["beta_u"]
    errors = [rov.estimates[name].error for name in ("a_d_u", "b_d_u")]
    expected.append(f"{a:.1f} ± {errors[0]:.1f} N·s²/m² and linear drag {b:.1f} ± {errors[1]:.1f} N·s/m")
    assert [error / value for error, value in zip(errors, (a, b), strict=True)] == pytest.approx([0.25, 0.25], abs=0.04)
    measured = {table.axis.name: table for table in load_tables(load_vehicle(VIDEORAY))}["surge"].steady
    (first, slowest), *_, (last, fastest) = measured.items()
    expected.append(f"{slowest} m/s to {fastest} m/s at {first} % to {last} %")
    off = [float(V) / rov.response(SURGE, float(command) / 100.0)[0] - 1.0 for command, V in measured.items()]
    expected.append(f"scatter by {100.0 * float(np.std(off)):.0f} % about it")
    expected.append(f"the refit finds β = {rov['beta_w']:.2f}")
    expected.append(f"has `beta_u = {rov['beta_u']:.3g}`")
    expected.append(f"stops {inertia:.2f} kg")
    slow = inertia / a * log(1.0 + a * float(slowest) / b)
    expected.append(f"{slow:.2f} m of it below the slowest measured velocity")
    assert [words for words in expected if words not in text(STOPPING)] == [], "\n".join(expected)
    (told,) = re.findall(r"Stop the thrusters ([\d.]+) m before", text(STOPPING))
    assert float(told) - 0.1 < stopped["wall"].runs.stopping_distance.quantile(0.95) < float(told)
    assert [len(stopped[name].warnings) for name in ("stop", "wall")] == [0, 0]
    assert stopped["stop"].trajectories([0]).set_index("t").u[30.0] < 1e-3, "it has stopped"


@pytest.mark.weekly
def test_a_learned_policy_and_the_autopilot_hold_station_as_the_page_says(capsys: Capsys) -> None:
    hold_station.main()
    policy, autopilot = map(float, re.findall(r"-\d+\.\d", capsys.readouterr().out))
    assert (policy, autopilot) == pytest.approx((-30.3, -80.8), abs=0.5)
    page = (ROOT / "docs" / "python.md").read_text("utf-8")
    assert f"its mean return is −{-autopilot:.0f}" in page
    assert f"learns in 20 s is −{-policy:.0f}." in page
