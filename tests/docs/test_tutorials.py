"""The figures that the tutorials quote are those of their data and of the simulated water that these come from.

A test that fails tells the rows as they are now.
"""

import re
from math import log
from pathlib import Path

import pytest

from examples.dive_log import CURRENT, bluerov2, dive, write_log
from examples.tank_tests import DELAY, OTTER, write_tests
from rov_fmu.identify.identification import Identification
from rov_fmu.identify.identify import identify
from rov_fmu.identify.recordings.recordings_fit import FittedEffect
from rov_fmu.model.rov import Rov
from rov_fmu.report.findings import accuracies
from rov_fmu.study import Results, study
from rov_fmu.tank.tank_tests import load_tank_tests
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import REFIT, ROOT
from tests.vehicles import at_rest, still

TANK, DIVE, STOP = (ROOT / "docs" / f"tutorial-{name}.md" for name in ("tank-tests", "dive-log", "stopping-distance"))


@pytest.fixture(scope="module")
def otter(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    folder = tmp_path_factory.mktemp("otter")
    write_tests(folder)
    return identify(load_tank_tests(folder))


@pytest.fixture(scope="module")
def harbour(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    folder = tmp_path_factory.mktemp("harbour")
    (rov_toml,) = re.findall(
        r"harbour/rov.toml <<END\n(.*?)^END$", DIVE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    (folder / "rov.toml").write_text(rov_toml, encoding="utf-8")
    write_log(folder / "log_dive.tlog", dive())
    return identify(load_tank_tests(folder))


def text(page: Path) -> str:
    """A tutorial, with its lines joined."""
    return " ".join(page.read_text(encoding="utf-8").split())


def misses(found: Identification, truth: Rov) -> list[str]:
    """Return the coefficients whose interval does not contain the truth."""
    intervals = {name: of for name, of in found.vehicle.intervals.items() if name in truth.coefficients}
    return [name for name, (low, high) in intervals.items() if not low <= truth[name] <= high]


def kept(found: Identification) -> list[FittedEffect]:
    """What else acts."""
    return [e for axis in found.axes if axis.recordings for e in axis.recordings.effects if e.kept and e.interval]


def ratios(found: Identification) -> list[float]:
    """Return how far predictions over 10 s of data that was not fitted are off, by the noise of the sensor."""
    errors = [e for axis in found.axes if axis.held_out for e in accuracies(axis.axis, axis.held_out.errors)]
    return [e.predicted / e.noise for e in errors if e.span == "10 s"]


@pytest.mark.long
def test_otter(otter: Identification) -> None:
    names = re.findall(r'"((?:a_d|b_d|beta|F_0)_[uwr])"', text(TANK))
    assert len(names) == 10
    assert [name for name in misses(otter, OTTER) if name in names] == ["b_d_u", "b_d_r"], "and no other"
    assert all(otter.vehicle.rov[name] == pytest.approx(OTTER[name], rel=0.0101) for name in names), "right to 1 %"
    truth = {"delay": DELAY, "load": OTTER["F_0_w"]}
    assert sorted(effect.kind for effect in kept(otter)) == ["delay", "delay", "delay", "load"]
    assert all(effect.value == pytest.approx(truth[effect.kind], abs=0.003) for effect in kept(otter))
    assert len(ratios(otter)) == 6
    assert max(ratios(otter)) < 1.1, "what remains is the sensor, not the model"
    ((force, command, model),) = re.findall(
        r"differs by −(\d+) % .*? at (\d+) %, which .*? differ by −(\d+) %", text(TANK)
    )
    said = f"force differs by -{force}% from positive to negative commands at {command}%"
    assert any(said in line and f"-{model}%" in line for line in otter.warnings), otter.warnings


@pytest.mark.long
def test_half_thrust_ahead_ends_where_the_tutorial_says(otter: Identification) -> None:
    ends = []
    for rov in (otter.vehicle.rov, OTTER):
        inputs = still(rov) | {"u_l": 0.5, "u_r": 0.5}
        ends.append(rov.step(inputs, at_rest(rov), 10.0)["u"])
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)
    assert f"Otter itself reaches {ends[1]:.3f} m/s" in text(TANK)


@pytest.mark.long
def test_dive(harbour: Identification) -> None:
    """Of 14 intervals of 95 %, at most two miss the truth, and predictions are about as good as the sensors."""
    assert len(harbour.vehicle.intervals) == 14
    assert len(misses(harbour, bluerov2())) <= 2
    currents = {e.kind.removeprefix("current "): e.value for e in kept(harbour) if e.kind.startswith("current")}
    assert (currents["north"], currents["east"]) == pytest.approx(CURRENT, abs=0.003)
    assert len(ratios(harbour)) == 8
    assert max(ratios(harbour)) < 1.5


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Results]:
    """The studies of the tutorial, and the first without the correlations of its vehicle."""
    folder = tmp_path_factory.mktemp("stopping")
    plans = dict(
        re.findall(r"> (\w+)\.toml <<END\n(.*?)^END$", STOP.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    )
    assert [*plans] == ["stop", "wall"]
    plans["wall"] += plans["stop"]
    plans["alone"] = plans["stop"].replace('"videoray_refit"', '"alone.toml"')
    vehicle = re.sub(r"^\[estimates\]\n(?:\w+ = .*\n)+", "", REFIT.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (folder / "alone.toml").write_text(vehicle, encoding="utf-8")
    found = {}
    for name, plan in plans.items():
        (folder / f"plan_{name}.toml").write_text(plan, encoding="utf-8")
        found[name] = study(folder / f"plan_{name}.toml", folder / name)
    return found


@pytest.mark.long
def test_the_stopping_distance_is_as_uncertain_as_told(stopped: dict[str, Results]) -> None:
    expected = []
    for name in ("stop", "wall"):
        for figure, words in (("speed", "speed, m/s"), ("stopping_distance", "stopping distance, m")):
            low, middle, high = stopped[name].runs[figure].quantile([0.05, 0.5, 0.95])
            expected.append(f"| {words} | {low:.3g} | {middle:.3g} | {high:.3g} |")
    index = stopped["wall"].sensitivity("stopping_distance")
    for of in ("beta_u", "a_d_u, b_d_u"):
        expected.append(f"| `{of}` | {index.S1[of]:.2f} | {index.S1_95[of]:.2f} |")
    low, high = stopped["alone"].runs.stopping_distance.quantile([0.05, 0.95])
    expected.append(f"the same study would give {low:.3g} m to {high:.3g} m")
    rov = load_vehicle(REFIT).rov
    a, b = rov["a_d_u"], rov["b_d_u"]
    expected.append(f"{rov['m_rov'] / a * log(1.0 + a * 0.31 / b):.2f} m of it are gone at less than 0.31 m/s")
    assert [words for words in expected if words not in text(STOP)] == [], "\n".join(expected)


@pytest.mark.long
def test_what_the_tutorial_says_of_the_stopping_distance_is_so(stopped: dict[str, Results]) -> None:
    distance = {name: results.runs.stopping_distance for name, results in stopped.items()}
    assert distance["wall"].median() > distance["stop"].quantile(0.95)
    assert distance["wall"].quantile(0.95) < 1.25
    assert [len(stopped[name].warnings) for name in ("stop", "wall", "alone")] == [0, 1, 1]
    assert "a_d_u and b_d_u" in stopped["wall"].warnings[0]
    at = stopped["stop"].trajectories([0]).set_index("t")
    assert at.u[30.0] < 1e-3, "it has stopped"
    table = "".join(
        line
        for line in REFIT.read_text(encoding="utf-8").splitlines(True)
        if line.startswith(("a_d_u = { e", "b_d_u = { e"))
    )
    assert f"[estimates]\n{table}" in STOP.read_text(encoding="utf-8")
