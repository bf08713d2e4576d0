"""Tests that cannot be used are left out with a finding, and the rest is identified."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.identify import identify as module
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import load_tank_tests
from rov_fmu.identify.findings import FACTS
from rov_fmu.identify.identification import Identification
from rov_fmu.identify.identify import identify
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.simulation.limits import MotionError, NoFitError
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.model.layout import HEAVE, SURGE, YAW
from tests.folders import ARM, BLUEROV2, FORCE, HEAD, MASS, SPEED, TURNS, folder_of
from tests.recordings import PLANS, clean, write_log
from tests.vehicles import VIDEORAY

TOP = f"{FORCE}\n0.1,0.07\n0.3,0.6\n0.5,1.65\n0.7,3.23\n-0.3,-0.6\n-0.7,-3.23\n"
REAR = f"{FORCE}\n0.1,0.7\n0.3,4.67\n0.5,12.1\n0.7,22.9\n-0.3,-4.67\n-0.7,-22.9\n"
STILL = "time [s],command [%],depth [m]\n" + "".join(f"{n / 10},{30 * (n > 9)},1.5\n" for n in range(50))
SLOW = "time [s],command [%],depth [m]\n" + "".join(f"{n / 10},{30 * (n > 9)},{1e-7 * n:.7f}\n" for n in range(50))
Fit = Callable[..., Any]


def folder(path: Path, **logs: str) -> Path:
    """Write a folder with two logs of heave and others."""
    folder_of(path, f"{HEAD}[known]\n{MASS}{TURNS}{ARM}", {"thrust_top.csv": TOP})
    for n, plan in enumerate(PLANS["heave"][:2]):
        write_log(path, str(n), clean(VIDEORAY, HEAVE, plan, 10.0).noisy(np.random.default_rng(n)))
    for name, text in logs.items():
        (path / f"{name}.csv").write_text(text, encoding="utf-8")
    return path


def files(found: Identification) -> list[str]:
    """Return the recordings that were fitted."""
    return [s.recording.file for result in found.axes if result.recordings for s in result.recordings.simulations]


def left_out(found: Identification) -> dict[str, str]:
    """Return the kinds of findings about files."""
    return {finding.file: finding.kind for finding in found.findings if finding.file}


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (STILL, "constant motion", "the recording of heave is left out: the depth never changes"),
        pytest.param(
            SLOW,
            "impossible velocity",
            "the recording of heave is left out: depth gives a velocity of",
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_recording_that_teaches_nothing_is_left_out(text: str, kind: str, words: str, tmp_path: Path) -> None:
    found = identify(load_tank_tests(folder(tmp_path, log_heave_2=text)))
    assert files(found) == ["log_heave_0.csv", "log_heave_1.csv"]
    assert left_out(found)["log_heave_2.csv"] == kind
    (told,) = (line for line in found.facts + found.warnings if line.startswith("log_heave_2.csv"))
    assert told.startswith(f"log_heave_2.csv: {words}")
    assert told in (found.facts if kind in FACTS else found.warnings)
    made = found.vehicle.provenance
    assert made
    assert (made.warnings, made.facts) == (found.warnings, found.facts)
    assert not {*made.warnings} & {*made.facts}
    assert made.data == "tank tests"
    assert "log_heave_2.csv" in made.inputs


def test_an_axis_without_a_usable_test_goes(tmp_path: Path) -> None:
    still = STILL.replace("depth", "heading").replace("[m]", "[deg]")
    found = identify(load_tank_tests(folder(tmp_path, log_yaw=still, thrust_rear=REAR)))
    assert [result.axis for result in found.axes] == [HEAVE]
    assert not found.vehicle.layout.has(YAW)
    kinds = {(finding.kind, finding.axis or finding.curve) for finding in found.findings}
    assert {("constant motion", "yaw"), ("axis left out", "yaw"), ("unused curve", "rear")} <= kinds


def test_a_folder_from_which_nothing_can_be_learnt_is_refused(tmp_path: Path) -> None:
    """The BlueROV2 that ships stays what it is, so nothing is learnt of it."""
    path = folder_of(tmp_path, BLUEROV2, {"log_heave.csv": STILL})
    with pytest.raises(DataFileError) as error:
        identify(load_tank_tests(path))
    assert str(error.value) == f"{path / 'log_heave.csv'}: depth never changes: nothing is identifiable"


def test_tables_remain_where_the_recordings_cannot_be_used(tmp_path: Path) -> None:
    path = folder_of(tmp_path, f"{HEAD}[known]\n{MASS}", {"thrust_top.csv": TOP, "log_heave.csv": STILL})
    (path / "steady_heave.csv").write_text(f"{SPEED}\n0.3,0.163\n0.5,0.28\n0.7,0.4\n", encoding="utf-8")
    (result,) = identify(load_tank_tests(path)).axes
    assert result.chosen == "points"


def failing(fit: Fit, fails: Callable[[Sequence[Recording]], bool], error: Exception) -> Fit:
    """Return a fit that fails for some recordings."""

    def fit_or_fail(recordings: Sequence[Recording], *args: object, **options: object) -> object:
        if fails(recordings):
            raise error
        return fit(recordings, *args, **options)

    return fit_or_fail


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (
            NoFitError("log_heave_1.csv", "no vehicle moves so: a_d = 9 would do it best. Check units"),
            "no vehicle moves",
        ),
        pytest.param(
            MotionError("the motion cannot be computed"),
            "the motion cannot be computed. Check the units and signs",
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_recording_that_no_vehicle_fits_is_left_out(
    error: Exception, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def with_second(recordings: Sequence[Recording]) -> bool:
        return any(recording.file == "log_heave_1.csv" for recording in recordings)

    monkeypatch.setattr(module, "fit_recordings", failing(fit_recordings, with_second, error))
    found = identify(load_tank_tests(folder(tmp_path)))
    assert files(found) == ["log_heave_0.csv"]
    (line,) = (
        line
        for line in found.warnings
        if line.startswith("log_heave_1.csv: the recording of heave is left out, because")
    )
    assert reason in line
    assert found.vehicle.rov["a_d_w"] == pytest.approx(VIDEORAY["a_d_w"] / VIDEORAY["alpha_w"], rel=0.1)


def test_recordings_that_no_vehicle_fits_have_each_their_own_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fit_or_fail(recordings: Sequence[Recording], *args: object, **options: object) -> object:
        for recording in recordings:
            if recording.file != "log_heave_0.csv":
                raise NoFitError(recording.file, f"{recording.file[10]} moves so. Check units")
        return fit_recordings(recordings, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "fit_recordings", fit_or_fail)
    second = (folder(tmp_path) / "log_heave_1.csv").read_text(encoding="utf-8")
    found = identify(load_tank_tests(folder(tmp_path, log_heave_2=f"{second}\n")))
    told = [line for line in found.warnings if "the recording of heave is left out" in line]
    assert [line.partition(". ")[0] for line in told] == [
        f"log_heave_{n}.csv: the recording of heave is left out, because {n} moves so" for n in (1, 2)
    ]
    assert files(found) == ["log_heave_0.csv"]


def test_where_nothing_fits_the_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    error = MotionError("the motion cannot be computed")
    monkeypatch.setattr(module, "fit_recordings", failing(fit_recordings, lambda _: True, error))
    path = folder(tmp_path)
    with pytest.raises(DataFileError) as refusal:
        identify(load_tank_tests(path))
    files = "log_heave_0.csv, log_heave_1.csv"
    assert str(refusal.value) == f"{path}: {files}: the motion cannot be computed. Check the units and signs"


def test_axes_that_fit_alone_only_are_fitted_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder_of(tmp_path, f"{HEAD}[known]\n{MASS}{TURNS}{ARM}", {"thrust_rear.csv": REAR})
    for axis in (SURGE, YAW):
        write_log(path, "0", clean(VIDEORAY, axis, PLANS[axis.name][0], 10.0).noisy(np.random.default_rng(0)))

    def both(recordings: Sequence[Recording]) -> bool:
        return len({recording.axis for recording in recordings}) == 2

    error = NoFitError("log_surge_0.csv", "no surge moves so")
    monkeypatch.setattr(module, "fit_recordings", failing(fit_recordings, both, error))
    found = identify(load_tank_tests(path))
    assert files(found) == ["log_surge_0.csv", "log_yaw_0.csv"]
    (line,) = (line for line in found.warnings if "each axis is fitted alone" in line)
    assert line.startswith("surge and yaw: no vehicle fits the recordings of all these axes together")


@pytest.mark.parametrize(
    ("full", "cause"), [(0.1, "Check the units and signs"), (0.5, "The thrusters are at full command")]
)
def test_the_likely_cause_is_told(full: float, cause: str) -> None:
    command = np.where(np.arange(100) < 100 * full, 1.0, 0.3)
    recording = Recording("log.csv", HEAVE, "depth", np.arange(100.0), command, np.zeros(100))
    assert module._likely_cause([recording], VIDEORAY).startswith(cause)
