"""Wrong units, scales and signs in files: each leads to a warning or a refusal with the name of the file."""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.cli import main
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import load_tank_tests
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.identify import identify
from rov_fmu.identify.slips.search import Tables, beta_out_of_range, slips, weak_thrust
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle
from tests.pool import Run, run
from tests.recordings import AXES, PLANS
from tests.vehicles import VIDEORAY

_COLUMN = {"distance": "distance [m]", "depth": "depth [m]", "heading": "heading [deg]", "velocity": "velocity [m/s]"}
SENSOR = {"surge": "distance", "heave": "depth", "yaw": "heading"}
K = VIDEORAY.replaced({"beta_u": 0.8})
KNOWN = ("m_rov", "I_r", "R", "gamma", "a_t_rear", "b_t_rear", "a_t_top", "b_t_top", "alpha_u", "alpha_w", "alpha_r")


@dataclass(frozen=True)
class Slip:
    """A mistake in a file: the factors of values and commands, and the words that the message must have."""

    axis: Axis
    value: float = 1.0
    command: float = 1.0
    words: str = ""


_SCALE, _TURNED = r"\bunit|\bscale|\bcm\b|\b100?\b", r"\bsign|direction|against the command"
SLIPS = {
    "distances a tenth": Slip(SURGE, value=0.1, words=_SCALE),
    "distances a hundredfold": Slip(SURGE, value=100.0, words=_SCALE),
    "depths a tenth": Slip(HEAVE, value=0.1, words=_SCALE),
    "depths a hundredfold": Slip(HEAVE, value=100.0, words=_SCALE),
    "radians under degrees": Slip(YAW, value=np.pi / 180.0, words=r"\brad|\bunit"),
    "degrees under radians": Slip(YAW, value=180.0 / np.pi, words=r"\bdeg|\brad|\bunit"),
    "fractions under percent": Slip(HEAVE, command=0.01, words=r"fraction|percent|%|\[1\]"),
    "heave up": Slip(HEAVE, value=-1.0, words=_TURNED),
    "yaw to port": Slip(YAW, value=-1.0, words=_TURNED),
    "surge astern": Slip(SURGE, value=-1.0, words=_TURNED),
}


@cache
def runs(axis: Axis) -> tuple[Run, ...]:
    return tuple(run(K, axis, plan, 20.0) for plan in PLANS[axis.name])


def recordings(axis: Axis, seed: int = 0) -> list[Recording]:
    random = np.random.default_rng(seed)
    return [clean.recorded(random, SENSOR[axis.name], f"log_{axis.name}_{n}.csv") for n, clean in enumerate(runs(axis))]


def slipped(recording: Recording, slip: Slip) -> Recording:
    assert recording.command is not None
    return replace(recording, values=slip.value * recording.values, command=slip.command * recording.command)


def write_folder(folder: Path, written: Sequence[Recording]) -> Path:
    """Write a folder with logs of the VideoRay; mass, geometry, thrust and other axes are known."""
    declarations, others = K.layout.coefficients, {axis.name for axis in AXES} - {r.axis.name for r in written}
    drag = [axis.coefficient(kind) for axis in AXES if axis.name in others for kind in ("a_d", "b_d", "beta")]
    known = [
        f'{n} = {{ value = {K[n]!r}, unit = "{declarations[n].unit}", source = "A pool" }}' for n in (*KNOWN, *drag)
    ]
    head = ['name = "An ROV"', 'identifier = "an_rov"', 'version = "1"', 'description = "An ROV"', 'source = "A pool"']
    text = "\n".join(["[vehicle]", *head, "[known]", *known]) + "\n"
    (folder / "rov.toml").write_text(text, encoding="utf-8")
    for recording in written:
        assert recording.command is not None
        values = np.degrees(recording.values) if recording.quantity == "heading" else recording.values
        table = np.column_stack([recording.time, 100.0 * recording.command, values])
        header = f"time [s],command [%],{_COLUMN[recording.quantity]}"
        np.savetxt(folder / recording.file, table, "%.6g", ",", header=header, comments="")
    return folder


def told(folder: Path) -> list[str]:
    """Return the warnings of an identification, or the lines of its refusal."""
    try:
        return list(identify(load_tank_tests(folder)).warnings)
    except (DataFileError, VehicleFileError) as refusal:
        return str(refusal).splitlines()


def names(sentences: Sequence[str], file: str, words: str) -> bool:
    """Return True when a sentence names the file and the likely cause."""
    about = (sentence for sentence in sentences if file in sentence)
    return any(re.search(words, sentence.replace(file, ""), re.IGNORECASE) for sentence in about)


HOW_MANY = ("one of three", "all")
# Each mistake by default, alternately in one recording and in all.
_BOTH = [(kind, HOW_MANY[(n + at) % 2], at) for n, kind in enumerate(SLIPS) for at in (0, 1)]


@pytest.mark.parametrize(
    ("kind", "how_many"), [pytest.param(*case, marks=[pytest.mark.long] * second) for *case, second in _BOTH]
)
def test_a_slip_is_named_or_refused(kind: str, how_many: str, tmp_path: Path) -> None:
    slip = SLIPS[kind]
    logs = recordings(slip.axis)
    wrong = logs[1:2] if how_many == "one of three" else logs
    sentences = told(write_folder(tmp_path, [slipped(r, slip) if r in wrong else r for r in logs]))
    assert any(names(sentences, r.file, slip.words) for r in wrong), sentences
    assert how_many == "all" or not any(names(sentences, r.file, "likely") for r in logs if r not in wrong), sentences


@pytest.mark.parametrize(
    ("axis", "number"), [(YAW, 2), *(pytest.param(axis, 3, marks=pytest.mark.long) for axis in AXES)]
)
def test_nothing_is_said_of_logs_without_slip(axis: Axis, number: int, tmp_path: Path) -> None:
    assert not told(write_folder(tmp_path, recordings(axis)[:number]))


# ---- Other vehicles, other logs --------------------------------------------------------------------------------------

VEHICLES = {name: load_vehicle(SHIPPED[name]).rov for name in ("bluerov2", "bluerov2_heavy")}
# Identification knows surge, sway, heave and yaw.
CASES = [(name, axis) for name, k in VEHICLES.items() for axis in (SURGE, SWAY, HEAVE, YAW) if k.layout.has(axis)]
# Factors that are found in a single file, by plausibility; a factor of 0.1 in lengths is not.
FACTORS = {"m": (-1.0, 0.01, 0.1, 100.0), "rad": (-1.0, np.pi / 180.0, 180.0 / np.pi)}


@cache
def swims(name: str, axis: Axis) -> tuple[Run, ...]:
    """Return clean runs along an axis; sway has the plan of surge."""
    k, plans = VEHICLES[name], PLANS.get(axis.name, PLANS["surge"])
    signs, gains = k.layout.signs(axis), k.layout.gains
    reaching = {t: sum(gain * signs.get(u, 0.0) for u, gain in gains[t].items()) for t in gains}
    return tuple(run(k, axis, plan, 20.0, pattern={t: c for t, c in reaching.items() if c}) for plan in plans)


def sensed(name: str, axis: Axis, seed: int = 0) -> list[Recording]:
    random = np.random.default_rng(seed)
    return [clean.recorded(random, axis.position, f"{n}.csv") for n, clean in enumerate(swims(name, axis))]


@pytest.mark.parametrize(
    ("name", "axis"),
    [pytest.param(*case, marks=[] if case == ("bluerov2", SWAY) else [pytest.mark.long]) for case in CASES],
    ids=lambda part: getattr(part, "name", part),
)
def test_slips_of_other_vehicles_are_told_from_none(name: str, axis: Axis) -> None:
    k, logs = VEHICLES[name], sensed(name, axis)
    assert not slips({axis.name: logs}, k)
    assert not slips({axis.name: logs[:1]}, k)
    for factor in FACTORS[axis.position_unit]:
        wrong = [replace(log, values=factor * log.values) for log in logs]
        assert [f.file for f in slips({axis.name: [logs[0], wrong[1], logs[2]]}, k) if f.certain] == ["1.csv"]
        assert [f.file for f in slips({axis.name: wrong[2:]}, k)] == ["2.csv"]


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_nothing_is_said_of_a_sensor_that_tells_of_no_motion(axis: Axis) -> None:
    log = recordings(axis)[0]
    for seed in range(3):
        noise = 0.01 * np.random.default_rng(seed).standard_normal(len(log.time))
        assert not slips({axis.name: [replace(log, values=noise)]}, K)


# ---- Tables ----------------------------------------------------------------------------------------------------------


def tables(axis: Axis, velocity: float = 1.0, time_constant: float = 1.0) -> tuple[dict[str, Tables], ...]:
    """Return both tables of an axis, each multiplied by a factor."""
    found = [(c, K.response(axis, c)) for c in (0.2, 0.3, 0.5, 0.7, -0.5)]
    steady = {"steady.csv": [(c, velocity * V_ss) for c, (V_ss, _) in found]}
    return {axis.name: steady}, {axis.name: {"tau.csv": [(c, time_constant * Tau) for c, (_, Tau) in found]}}


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_slips_in_tables(axis: Axis) -> None:
    assert not slips({}, K, (), *tables(axis))
    for factor, kind in ((1000.0, "slow time constants"), (0.001, "fast time constants")):
        (found,) = slips({}, K, (), *tables(axis, time_constant=factor))
        assert (found.kind, found.certain) == (kind, True)
    for factor in FACTORS[axis.position_unit][1:]:
        if factor != 0.1:
            (found,) = slips({}, K, (), *tables(axis, factor))
            assert found.file == "steady.csv"


def test_a_table_that_contradicts_recordings_is_refused() -> None:
    logs = recordings(HEAVE)
    assert not slips({"heave": logs}, K, (), *tables(HEAVE))
    (found,) = slips({"heave": logs}, K, (), *tables(HEAVE, 0.1))
    assert (found.file, found.certain) == ("steady.csv", True)


# ---- β of the final fit ----------------------------------------------------------------------------------------------


def test_a_beta_that_no_vehicle_has_is_told() -> None:
    assert beta_out_of_range(K, HEAVE, {}) is None
    for beta in (0.04, 1.3):
        found = beta_out_of_range(K.replaced({"beta_w": beta}), HEAVE, {})
        assert found
        assert (found.axis, found.numbers["value"]) == ("heave", beta)
    heavy = VEHICLES["bluerov2_heavy"]
    assert beta_out_of_range(heavy.replaced({"beta_w": 2.0}), HEAVE, {}) is None
    found = beta_out_of_range(heavy.replaced({"beta_w": 0.2}), HEAVE, {})
    assert found
    assert found.names["inertia"] == "5 times m_rov and the added one"


# ---- Time ------------------------------------------------------------------------------------------------------------


def of_6000_rows() -> list[Recording]:
    """Return nine recordings of 60 s at 100 Hz."""
    random = np.random.default_rng(0)
    return [
        run(K, axis, plan, 100.0).recorded(random, SENSOR[axis.name], f"log_{axis.name}_{n}.csv")
        for axis in AXES
        for n, plan in enumerate(PLANS[axis.name])
    ]


def never_at_rest() -> list[Recording]:
    """Return five recordings of a joystick, which gives another command at each of 3,000 rows."""
    rate, at = 50.0, np.arange(3000) / 50.0
    random = np.random.default_rng(0)
    logs = []
    for n in range(5):
        low, high = random.uniform(0.2, 0.6), random.uniform(0.8, 2.0)
        commands = 0.45 * np.sin(low * at) + 0.25 * np.sin(high * at)
        stick = run(K, HEAVE, [(c, 1.0 / rate) for c in commands.tolist()], rate)
        logs.append(stick.recorded(random, "depth", f"log_heave_{n}.csv"))
    return logs


@pytest.mark.long
@pytest.mark.parametrize(("logs", "seconds"), [(of_6000_rows, 45.0), (never_at_rest, 40.0)])
def test_an_identification_takes_seconds(logs: Callable[[], list[Recording]], seconds: float, tmp_path: Path) -> None:
    """The whole command runs, without the report; the limits are five times what was measured."""
    folder = write_folder(tmp_path, logs())
    began = time.process_time()  # of this process alone, whatever else the machine does
    assert main(["identify", str(folder)]) == 0
    assert time.process_time() - began <= seconds


@pytest.mark.parametrize(
    ("beta_u", "beta_r", "curves", "said"),
    [
        (
            1.4,
            1.3,
            ("rear", "top"),
            "at least 1.3 times as strong: are they of one thruster, and not of all 2 together?",
        ),
        (1.4, 0.9, ("rear", "top"), ""),  # only one axis is beyond the range
        (7.0, 1.3, ("rear", "top"), ""),  # not by one cause
        (1.4, 1.3, ("top",), ""),  # not from forces
    ],
)
def test_weak_forces_are_seen_in_all_axes_of_a_curve(
    beta_u: float, beta_r: float, curves: tuple[str, ...], said: str
) -> None:
    rov = VIDEORAY.replaced({"beta_u": beta_u, "beta_r": beta_r})
    (line,) = sentences(weak_thrust(rov, curves, [SURGE, HEAVE, YAW])) or ("",)
    assert line.endswith(said)
    assert bool(line) == bool(said)


@pytest.mark.parametrize(
    ("beta", "interval", "is_told"),
    [
        (1.06, (1.04, 1.07), True),
        (1.06, (0.99, 1.13), False),
        (1.01, (1.005, 1.015), False),
        (0.97, (0.96, 0.98), False),
    ],
)
def test_an_inertia_below_the_mass_is_told(beta: float, interval: tuple[float, float], is_told: bool) -> None:
    """It would be a negative added mass, as when two thrusters are swapped in rov.toml."""
    found = beta_out_of_range(K.replaced({"beta_w": beta}), HEAVE, {"beta_w": interval})
    assert bool(found) == is_told
    if found:
        (sentence,) = sentences([found])
        assert sentence.startswith(f"heave: beta_w = {beta:.3g} ({interval[0]:.3g} to {interval[1]:.3g}) is above 1")
        assert "positions and directions of the thrusters" in sentence
    heavy = VEHICLES["bluerov2_heavy"].replaced({"beta_w": beta})
    assert beta_out_of_range(heavy, HEAVE, {"beta_w": interval}) is None, "it has an added mass of its own"
