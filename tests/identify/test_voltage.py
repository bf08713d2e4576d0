"""The exponent of the thrust over the voltage: found where it acts, and absent where the voltage acts on nothing."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.findings import result_sentences
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import Identification
from rov_fmu.tank.description import ROV_FILE
from verification.identification.strangers.drawn import draw
from verification.identification.strangers.kinds import AS_MODELLED, Kind
from verification.identification.strangers.water import ROW, Array, Body, Moment

FULL = 16.0
FITTED = f"""
[known]
V_0_main = {{ value = {FULL}, unit = "V", source = "measured" }}
[fit]
voltage = true
"""


@dataclass(frozen=True)
class Battery:
    """A battery whose voltage is logged."""

    exponent: float
    """Thrust is proportional to this power of the voltage: 0 for thrusters whose speed is regulated."""
    sag: float = 0.0
    """The share of the voltage that is lost in 100 s."""
    droop: float = 0.0
    """The share that is lost at full command."""
    noise: float = 0.03
    """V."""

    def voltage(self, clock: Array, command: Array) -> Array:
        """Return the voltage at n times for commands of 4 x n, V."""
        return np.asarray(FULL * (1.0 - 0.01 * self.sag * clock - self.droop * np.max(command**2, axis=0)))

    def act(self, m: Moment, _: Body) -> None:
        if m.where != "bench":
            m.gain *= (self.voltage(m.clock, m.command) / FULL) ** self.exponent


def add_column(log: Path, cells: list[str]) -> None:
    rows = log.read_text(encoding="utf-8").splitlines()
    log.write_text("\n".join(map(",".join, zip(rows, cells, strict=True))), encoding="utf-8")


def write(folder: Path, battery: Battery, seed: int = 0, count: int = 1) -> Path:
    """Write two dives of a vehicle with 1 or 2 axes, and their voltage as the last column."""
    drawn, random = draw(seed, count, Kind("", "", battery.act)), np.random.default_rng(seed)
    drawn.write(folder)
    with (folder / ROV_FILE).open("a", encoding="utf-8") as file:
        file.write(FITTED)
    for n, begun in enumerate(drawn.begins):
        clock = begun + ROW * np.arange(len(drawn.commands))
        volts = battery.voltage(clock, drawn.commands[:, :, n].T) + battery.noise * random.standard_normal(len(clock))
        add_column(folder / f"dive_{n}.csv", ["voltage [V]", *(f"{x:.4f}" for x in volts)])
    return folder


def without_column(folder: Path, to: Path) -> Identification:
    """The result for the same folder without the voltage, which is the last column."""
    to.mkdir()
    for file in folder.iterdir():
        text = file.read_text(encoding="utf-8")
        if file.name == ROV_FILE:
            text = text.replace(FITTED, "")
        elif file.name.startswith("dive"):
            text = re.sub(r"(?m),[^,\n]*$", "", text)
        (to / file.name).write_text(text, encoding="utf-8")
    return identify(load_tests(to))


def check_idle(folder: Path, battery: Battery, seed: int, count: int) -> None:
    """The voltage is told to act on nothing. No answer moves by more than a quarter of its interval's half-width."""
    found = identify(load_tests(write(folder / "with", battery, seed, count)))
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


@pytest.mark.weekly
def test_a_voltage_that_acts_on_nothing_changes_no_answer(tmp_path: Path) -> None:
    """It sags with time and under load, and the speed of the thrusters is regulated."""
    check_idle(tmp_path, Battery(0.0, sag=0.1, droop=0.1), 0, 1)


@pytest.mark.parametrize("number", ["0", "65.535"])
def test_a_voltage_that_nothing_measures_is_as_no_column(number: str, tmp_path: Path) -> None:
    draw(0, 1, AS_MODELLED).write(tmp_path)
    without, others, _ = begin(load_tests(tmp_path))
    for dive in tmp_path.glob("dive*"):
        add_column(dive, ["voltage [V]", *[number] * (len(dive.read_text(encoding="utf-8").splitlines()) - 1)])
    tests = load_tests(tmp_path)
    assert not tests.folder.voltages
    known, logs, _ = begin(tests)
    assert (known.coefficients, known.layout) == (without.coefficients, without.layout)
    for log, other in zip(logs, others, strict=True):
        assert np.array_equal(log.record.inputs, other.record.inputs)


def test_a_log_without_voltage_beside_one_with_it_has_that_of_the_vehicle(tmp_path: Path) -> None:
    """Such as one along a tape. At 0 V its thrusters would push nothing."""
    first, second = sorted(write(tmp_path, Battery(1.0, sag=0.2)).glob("dive*"))
    second.write_text(re.sub(r"(?m),[^,\n]*$", "", second.read_text(encoding="utf-8")), encoding="utf-8")
    rov = tmp_path / ROV_FILE
    rov.write_text(rov.read_text(encoding="utf-8").replace(FITTED, ""), encoding="utf-8")
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
    check_idle(tmp_path, battery, seed, 2)


@pytest.mark.parametrize(
    ("exponent", "seed"),
    [(0.5, 0), *(pytest.param(n, seed, marks=pytest.mark.weekly) for n in (0.5, 1.0, 1.5, 2.0) for seed in range(5))],
)
def test_an_exponent_is_found(exponent: float, seed: int, tmp_path: Path) -> None:
    found = identify(load_tests(write(tmp_path, Battery(exponent, sag=0.12, droop=0.06), seed)))
    (effect,) = (one for one in found.effects if one.kind == "voltage")
    low, high = effect.interval
    assert effect.kept
    assert low <= exponent <= high
    assert high - low < 0.6
    assert found.vehicle["n_V_main"] == pytest.approx(exponent, abs=0.3)
