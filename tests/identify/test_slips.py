"""Wrong units, scales and signs in files: each leads to a question about the file, or to a refusal that names it."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.findings import result_sentences
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood import file_fit
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.search import StructureSearch
from rov_fmu.identify.likelihood.solve import Minimum, minimise
from rov_fmu.identify.result import ALARM, KEPT
from rov_fmu.identify.unexplained import slips as module
from rov_fmu.identify.unexplained.slips import slips
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import VehicleFileError
from tests.folders import HEAD, folder_of
from tests.identify.conftest import FORCES, KNOWN
from tests.often import spread
from tests.recordings import PLANS, Measured, run, write_dives
from tests.vehicles import VIDEORAY

SENSOR = {"surge": "distance", "heave": "depth", "yaw": "heading"}
KNOTS, FEET = 3600.0 / 1852.0, 1.0 / 0.3048
_COLUMN = {"velocity": "velocity [m/s]", "distance": "distance [m]", "depth": "depth [m]", "heading": "heading [deg]"}
RATE = 5.0


@dataclass(frozen=True)
class Slip:
    """A mistake in a file: the factors of values and commands, and the words that the message must have."""

    axis: Axis
    value: float = 1.0
    command: float = 1.0
    words: str = ""


_SCALE, _TURNED = r"\bunit|\bscale|\bin (mm|cm|dm|m|km)\b|\b100?\b", r"\bsign|direction|against the command|positive"
SLIPS = {
    "heave up": Slip(HEAVE, value=-1.0, words=_TURNED),
    "depths a hundredfold": Slip(HEAVE, value=100.0, words=_SCALE),
    "distances a hundredfold": Slip(SURGE, value=100.0, words=_SCALE),
    "depths a tenth": Slip(HEAVE, value=0.1, words=_SCALE),
    "distances a tenth": Slip(SURGE, value=0.1, words=_SCALE),
    "depths in feet": Slip(HEAVE, value=FEET, words=r"\bft"),
    "distances in feet": Slip(SURGE, value=FEET, words=r"\bft"),
    "radians under degrees": Slip(YAW, value=np.pi / 180.0, words=r"\brad|\bunit"),
    "degrees under radians": Slip(YAW, value=180.0 / np.pi, words=r"\bdeg|\brad|\bunit"),
    "fractions under percent": Slip(HEAVE, command=0.01, words=r"fraction|percent|%|\[1\]"),
    "yaw to port": Slip(YAW, value=-1.0, words=_TURNED),
    "surge astern": Slip(SURGE, value=-1.0, words=_TURNED),
}
OFTEN = ("distances in feet",)
"""What the long tests plant in all logs."""


@cache
def recordings(axis: Axis) -> tuple[Measured, ...]:
    """Return three logs of about 40 s."""
    random = np.random.default_rng(0)
    return tuple(
        run(VIDEORAY, axis, plan[:4], RATE).noisy(random, SENSOR[axis.name], file=f"log_{axis.name}_{n}.csv")
        for n, plan in enumerate(PLANS[axis.name])
    )


def slipped(recording: Measured, slip: Slip) -> Measured:
    return replace(recording, values=slip.value * recording.values, command=slip.command * recording.command)


def write_folder(folder: Path, recordings: Sequence[Measured]) -> Path:
    """Write a folder with logs of the VideoRay."""
    folder_of(folder, f'base = "videoray"\n{HEAD}', {})
    for recording in recordings:
        values = np.degrees(recording.values) if recording.quantity == "heading" else recording.values
        table = np.column_stack([recording.time, 100.0 * recording.command, values])
        header = f"time [s],command [%],{_COLUMN[recording.quantity]}"
        np.savetxt(folder / recording.file, table, "%.6g", ",", header=header, comments="")
    return folder


def told(folder: Path) -> list[str]:
    """Return what an identification asks about the files, or the lines of its refusal."""
    try:
        found = identify(load_tests(folder))
    except (DataFileError, VehicleFileError) as refusal:
        return str(refusal).splitlines()
    return [*result_sentences(finding for finding in found.findings if finding.kind == "slip")]


def names(lines: Sequence[str], file: str, words: str) -> bool:
    """Return True when a line names the file and the likely cause."""
    about = (line for line in lines if file in line)
    return any(re.search(words, line.replace(file, ""), re.IGNORECASE) for line in about)


@pytest.mark.parametrize(
    ("kind", "how_many"),
    [
        *(pytest.param(kind, "one of three", marks=pytest.mark.weekly) for kind in SLIPS),
        *(pytest.param(kind, "all", marks=pytest.mark.long if kind in OFTEN else pytest.mark.weekly) for kind in SLIPS),
    ],
)
def test_a_slip_is_named_or_refused(kind: str, how_many: str, tmp_path: Path) -> None:
    slip = SLIPS[kind]
    logs = recordings(slip.axis)
    wrong = logs[1:2] if how_many == "one of three" else logs
    lines = told(write_folder(tmp_path, [slipped(r, slip) if r in wrong else r for r in logs]))
    assert any(names(lines, r.file, slip.words) for r in wrong), lines
    assert not any(r.file in line for line in lines for r in logs if r not in wrong), lines


FORWARD, STARBOARD, DOWN = (
    f"is its sign right ({axis.positive} is positive), and are the signs of the commands right"
    for axis in (SURGE, YAW, HEAVE)
)
QUESTIONS = {
    "heave up": DOWN,
    "depths a hundredfold": "is it in cm",
    "distances a tenth": "are its numbers 10 times too small for its unit",
    "radians under degrees": "is it in radians instead of degrees",
    "degrees under radians": "is it in degrees instead of radians",
    "yaw to port": STARBOARD,
    "surge astern": FORWARD,
}


def asked(folder: Path, *logs: Measured, rov: str) -> dict[tuple[str, str], str]:
    """Return what is asked about the first 30 s of some logs, by file and quantity. Forces replace a base."""
    some = [replace(r, **{key: getattr(r, key)[:150] for key in ("time", "command", "values")}) for r in logs]
    tests = load_tests(folder_of(write_folder(folder, some), rov, FORCES if "base" not in rov else {}))
    known, recorded, rows = begin(tests)
    objective = Objective.of_known(known, recorded, rows)
    found, left = slips(tests, objective, objective.mean, np.full(len(objective.mean), np.inf), {}, {})
    assert all(one.evidence > KEPT for one in found)
    assert left < ALARM or not found, "the mended logs agree"
    return {(one.file, one.quantity): one.words for one in found}


@pytest.mark.parametrize("kind", spread(QUESTIONS, ["depths a hundredfold", "yaw to port"], ["degrees under radians"]))
def test_a_slip_is_asked_in_its_words(kind: str, tmp_path: Path) -> None:
    """Nothing tells the drag but the log and the mass."""
    slip = SLIPS[kind]
    (log, *_), sensor = recordings(slip.axis), SENSOR[slip.axis.name]
    quantity = "surge distance" if slip.axis is SURGE else sensor
    assert asked(tmp_path, slipped(log, slip), rov=KNOWN) == {(log.file, quantity): QUESTIONS[kind]}


def test_a_second_search_fits_only_the_files_as_they_stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a fit of scaled channels finds does not depend on the fit to the files as they stand."""
    (log, *_), counts, fits, made = recordings(HEAVE), list[int](), list[Array](), module.Fits()

    def counted(objective: Objective, start: Array, **how: Any) -> Minimum:
        fits.append(start)
        return minimise(objective, start, **how)

    monkeypatch.setattr(module, "minimise", counted)
    tests = load_tests(folder_of(write_folder(tmp_path, [slipped(log, SLIPS["heave up"])]), KNOWN, FORCES))
    objective = Objective.of_known(*begin(tests))
    for _ in range(2):
        found, _ = slips(tests, objective, objective.mean, np.full(len(objective.mean), np.inf), {}, made)
        assert [one.words for one in found] == [QUESTIONS["heave up"]]
        counts.append(len(fits))
    assert counts[0] > 2
    assert counts[1] == counts[0] + 1


def test_a_fit_is_not_refined_where_a_slip_explains_the_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (log, *_), slip, shown = recordings(HEAVE), SLIPS["heave up"], list[str]()
    monkeypatch.setattr(StructureSearch, "_round", lambda _: pytest.fail("a structure is sought"))
    monkeypatch.setattr(file_fit, "_weakest", lambda *_: pytest.fail("weak effects are left out"))
    tests = load_tests(folder_of(write_folder(tmp_path, [slipped(log, slip)]), KNOWN, FORCES))
    found = identify(tests, lambda text, _: shown.append(text))
    assert shown
    assert not any("exact derivatives" in text for text in shown)
    assert [one.words for one in found.slips] == [QUESTIONS["heave up"]]
    assert [one.verdict.word for one in found.axes] == ["do not use"]


@pytest.mark.parametrize(
    ("axis", "quantity", "scale", "question"),
    [
        pytest.param(HEAVE, "depth", FEET, "is it in ft", marks=pytest.mark.weekly),
        pytest.param(SURGE, "velocity", KNOTS, "is it in knots", marks=pytest.mark.long),
    ],
)
def test_feet_and_knots_are_asked_about_where_another_log_shows_them(
    axis: Axis, quantity: str, scale: float, question: str, tmp_path: Path
) -> None:
    """The drag of the priors is right within a factor of e, which such a factor may be, too."""
    random, plan = np.random.default_rng(0), PLANS[axis.name][0]
    right, wrong = (
        run(VIDEORAY, axis, plan, RATE).noisy(random, quantity, file=f"log_{axis.name}_{n}.csv") for n in "12"
    )
    found = asked(tmp_path, right, replace(wrong, values=scale * wrong.values), rov=KNOWN)
    assert {file: words for (file, _), words in found.items()} == {wrong.file: question}


@pytest.mark.parametrize("axis", spread((HEAVE, SURGE, YAW), [HEAVE], [SURGE]))
def test_nothing_is_asked_of_a_log_without_slip(axis: Axis, tmp_path: Path) -> None:
    assert not asked(tmp_path, recordings(axis)[0], rov=KNOWN)


@pytest.mark.parametrize(("noise", "is_doubted"), [(0.0005, True), (0.02, False)])
def test_a_unit_is_doubted_only_where_the_motion_is_many_times_the_noise(
    noise: float, is_doubted: bool, tmp_path: Path
) -> None:
    """Depths a tenth of the true ones; their sign is doubted in both cases."""
    small = replace(recordings(HEAVE)[0], values=0.1 * recordings(HEAVE)[0].values)
    small = replace(small, values=small.values + np.random.default_rng(1).normal(0.0, noise, len(small.values)))
    tests = load_tests(folder_of(write_folder(tmp_path, [small]), KNOWN, FORCES))
    objective = Objective.of_known(*begin(tests), thinned=True)
    (match,) = module._matches(objective, 0, objective.table.known.guessed)
    assert (0.1 in match.scales) == is_doubted
    assert {*match.ratios} <= {1.0, -1.0} or is_doubted


@pytest.mark.parametrize(("ratio", "is_suspected"), [(0.91, False), (0.6, True)])
def test_knots_are_suspected_only_where_an_inertia_is_below_the_mass_by_more_than_weighing_tells(
    ratio: float, is_suspected: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However exact the fit: the VideoRay of the paper moves as if it had 91 % of its mass."""
    tests = load_tests(folder_of(write_folder(tmp_path, recordings(SURGE)[:1]), KNOWN, FORCES))
    known, recorded, rows = begin(tests)
    objective = Objective.of_known(known, recorded, rows)
    z, index = objective.mean.copy(), objective.table.index("inertia", "surge")
    assert index is not None
    z[index] = np.log(ratio * known.coefficients["beta_u"])
    tried: list[int] = []

    def customary(*found: Collection[Axis]) -> tuple[float, ...]:
        tried.append(len(found[-1]))
        return ()

    monkeypatch.setattr(module, "_customary", customary)
    assert slips(tests, objective, z, np.full(len(z), 1e-3), {}, {}) == ((), np.inf)
    assert tried == [int(is_suspected)]


@pytest.mark.weekly
def test_each_of_several_slips_is_asked_about(tmp_path: Path) -> None:
    """A sensor that shows nothing but noise is no slip, and hides none."""
    kinds = "depths a hundredfold", "radians under degrees"
    logs = [slipped(recordings(SLIPS[kind].axis)[0], SLIPS[kind]) for kind in kinds]
    short = {key: getattr(recordings(SURGE)[0], key)[:50] for key in ("time", "command")}
    noise = replace(recordings(SURGE)[0], values=np.random.default_rng(0).normal(0.0, 0.01, 50), **short)
    found = asked(tmp_path, *logs, noise, rov=f'base = "videoray"\n{HEAD}')
    assert found == {(log.file, SENSOR[log.axis.name]): QUESTIONS[kind] for log, kind in zip(logs, kinds, strict=True)}


def mirrored(folder: Path, *columns: str) -> Path:
    """Write dives in all axes, and return the last one, in which some columns have the other sign."""
    write_dives(folder, seed=0, count=3, seconds=60.0)
    file = sorted(folder.glob("*.csv"))[-1]
    header, *rows = (line.split(",") for line in file.read_text(encoding="utf-8").splitlines())
    for index in map(header.index, columns):
        for row in rows:
            row[index] = str(-float(row[index])) if row[index] else ""
    file.write_text("\n".join(",".join(row) for row in [header, *rows]), encoding="utf-8")
    return file


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("column", "axis"), [("surge velocity [m/s]", SURGE), ("depth [m]", HEAVE), ("heading [deg]", YAW)]
)
def test_a_mirrored_column_of_a_dive_in_all_axes_is_the_only_one_named(column: str, axis: Axis, tmp_path: Path) -> None:
    """The other columns of the file are right, though all thrusters move the vehicle at once."""
    file = mirrored(tmp_path, column)
    (line,) = told(tmp_path)
    assert names([line], file.name, rf"{axis.name} .*{_TURNED}")
