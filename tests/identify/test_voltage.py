"""The exponent of the thrust over the voltage: found where it acts, and absent where the voltage acts on nothing."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.findings import result_sentences
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import Identification
from rov_fmu.tank.description import ROV_FILE
from tests.identify.scenarios.drawn import Battery, Drawn, Fault

DIVE = Drawn(axes=("heave",), sensors=("heave",), seconds=40.0, has_voltage=True)


def identified(folder: Path, battery: Battery, seed: int = 0, dive: Drawn = DIVE) -> Identification:
    replace(dive, fault=Fault(battery=battery)).write(seed, folder)
    return identify(load_tests(folder))


def without_column(folder: Path, to: Path) -> Identification:
    """The result for the same folder without the voltage, which is the last column."""
    to.mkdir()
    for file in folder.iterdir():
        text = file.read_text(encoding="utf-8")
        if file.name == ROV_FILE:
            text = re.sub(r"(?s)\n\[known\].*", "\n", text)
        elif file.name.startswith("dive"):
            text = re.sub(r"(?m),[^,\n]*$", "", text)
        (to / file.name).write_text(text, encoding="utf-8")
    return identify(load_tests(to))


def check_idle(folder: Path, battery: Battery, seed: int, dive: Drawn = DIVE) -> None:
    """The voltage is told to act on nothing. No answer moves by more than a quarter of its interval's half-width."""
    found = identified(folder / "with", battery, seed, dive)
    other = without_column(folder / "with", folder / "without")
    assert found.vehicle.layout.voltage is None
    assert len(result_sentences(found.findings, "idle voltage")) == 1
    assert not result_sentences(other.findings, "idle voltage")
    for axis, beside in zip(found.axes, other.axes, strict=True):
        assert axis.verdict.word == beside.verdict.word
        for answer, unlogged in zip(axis.answers, beside.answers, strict=True):
            for (value, (low, high)), (without, _) in zip(
                (answer.steady, answer.rise, answer.stop), (unlogged.steady, unlogged.rise, unlogged.stop), strict=True
            ):
                assert abs(value - without) < 0.25 * 0.5 * abs(high - low), (answer, unlogged)


@pytest.mark.long
def test_a_voltage_that_acts_on_nothing_changes_no_answer(tmp_path: Path) -> None:
    """It sags with time and under load, and the speed of the thrusters is regulated."""
    check_idle(tmp_path, Battery(0.0, sag=0.1, droop=0.1), 0, replace(DIVE, seconds=25.0))


@pytest.mark.parametrize("number", ["0", "65.535"])
def test_a_voltage_that_nothing_measures_is_as_no_column(number: str, tmp_path: Path) -> None:
    replace(DIVE, has_voltage=False).write(0, tmp_path)
    dive = next(tmp_path.glob("dive*"))
    rows = dive.read_text(encoding="utf-8").splitlines()
    found = []
    for cells in (["voltage [V]", *[number] * (len(rows) - 1)], []):
        dive.write_text("\n".join(map(",".join, zip(rows, cells, strict=True)) if cells else rows), encoding="utf-8")
        tests = load_tests(tmp_path)
        assert not tests.folder.voltages
        found.append(begin(tests))
    (known, logs, _), (without, others, _) = found
    assert (known.coefficients, known.layout) == (without.coefficients, without.layout)
    for log, other in zip(logs, others, strict=True):
        assert np.array_equal(log.record.inputs, other.record.inputs)


def test_a_log_without_voltage_beside_one_with_it_has_that_of_the_vehicle(tmp_path: Path) -> None:
    """Such as one along a tape. At 0 V its thrusters would push nothing."""
    replace(DIVE, fault=Fault(battery=Battery(1.0, sag=0.1))).write(0, tmp_path)
    first, second = sorted(tmp_path.glob("dive*"))
    second.write_text(re.sub(r"(?m),[^,\n]*$", "", second.read_text(encoding="utf-8")), encoding="utf-8")
    rov = tmp_path / ROV_FILE
    rov.write_text(re.sub(r"(?s)\n\[known\].*", "\n", rov.read_text(encoding="utf-8")), encoding="utf-8")
    known, logs, _ = begin(load_tests(tmp_path))
    volts = {one.file: one.record.inputs[:, [*one.layout.inputs].index("voltage")] for one in logs}
    assert np.ptp(volts[first.name]) > 1.0
    assert known.layout.voltage == pytest.approx(np.mean(volts[first.name]), rel=0.02)
    assert set(volts[second.name]) == {known.layout.voltage}


@pytest.mark.weekly
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "battery",
    [Battery(0.0, noise=0.05), Battery(0.0, noise=0.0), Battery(0.0, sag=0.15), Battery(0.0, droop=0.15)],
    ids=["noisy", "constant", "time", "load"],
)
def test_no_idle_voltage_changes_an_answer(battery: Battery, seed: int, tmp_path: Path) -> None:
    check_idle(tmp_path, battery, seed, Drawn(seconds=40.0, has_voltage=True))


@pytest.mark.parametrize(
    ("exponent", "seed"),
    [(0.5, 0), *(pytest.param(n, seed, marks=pytest.mark.weekly) for n in (0.5, 1.0, 1.5, 2.0) for seed in range(5))],
)
def test_an_exponent_is_found(exponent: float, seed: int, tmp_path: Path) -> None:
    found = identified(tmp_path / "a", Battery(exponent, sag=0.12, droop=0.06), seed)
    (effect,) = (one for one in found.effects if one.kind == "voltage")
    low, high = effect.interval
    assert effect.kept
    assert low <= exponent <= high
    assert high - low < 0.6
    assert found.vehicle["n_V_main"] == pytest.approx(exponent, abs=0.3)
