"""The command `identify` as a function: the parts of its work and their progress."""

import re
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.fmu.related import origin
from rov_fmu.interface.identify_command import identify_tests
from rov_fmu.io.messages import Progress
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.folders import small_folder
from tests.tank.readers.writers import table


@pytest.mark.parametrize("with_report", [pytest.param(False, marks=pytest.mark.long), True])
def test_the_progress_names_what_is_done_and_never_goes_back(
    with_report: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # a vehicle that is from no file has its report in the current folder
    begun: dict[str, list[tuple[str, float]]] = {}

    def begin(name: str) -> Progress:
        begun[name] = []
        return lambda *call: begun[name].append(call)

    report = tmp_path / "report.html" if with_report else None
    folder = small_folder(tmp_path / "tests")
    answers: list[tuple[str, str]] = []
    identification, _ = identify_tests(
        [folder], tmp_path / "rov.toml", report, force=False, begin=begin, on_answer=lambda *told: answers.append(told)
    )
    for axis in identification.axes:
        told = [answer for name, answer in answers if name == axis.axis.name]
        match = re.fullmatch(rf"{axis.axis.name} ([\d.]+) \S+ at (\d+)%(, fits the .*)?", told[-1])
        assert match, "each axis has an answer before the end"
        speed = abs(identification.vehicle.response(axis.axis, float(match[2]) / 100.0)[0])
        assert float(match[1]) == pytest.approx(speed, rel=0.1)
    _check_is_the_same(identification.vehicle, tmp_path / "rov.toml")
    assert [*begun] == ["reading the tests", "identifying the vehicle", *["drawing the report"] * with_report]
    for calls in begun.values():
        shares = [share for _, share in calls if not np.isnan(share)]  # nobody knows how long a fit takes
        assert all(before <= after for before, after in pairwise(shares))
        assert not shares or (shares[0] == 0.0 and shares[-1] < 1.0)
    steps = [step for step, _ in begun["identifying the vehicle"]]
    assert {"reading the logs", "start 1", "all samples", "exact derivatives", "predicting what was left out"} <= {
        *steps
    }


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # of axes that no log shows
def test_a_log_alone_is_identified_with_a_vehicle_that_is_assumed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The printout begins with what is assumed; no verdict is good, and the file says which numbers are assumed."""
    time = 0.2 * np.arange(200.0)
    command = np.where(time % 10.0 < 5.0, 0.5, 0.0)
    still = [np.zeros(200)] * 4
    titles = ",".join(["time [s]", *(f"u_{n} [1]" for n in range(1, 7)), "heave velocity [m/s]"])
    # A first-order response, sampled without noise.
    speed = np.where(time % 10.0 < 5.0, 1.0 - np.exp(-(time % 10.0) / 0.7), np.exp(-(time % 10.0 - 5.0) / 0.7))
    table(tmp_path / "dive.csv", titles, time, *still, command, command, 0.6 * speed)
    (tmp_path / "other.csv").write_text("time [s],nothing\n0,1\n", encoding="utf-8")
    written = tmp_path / "mine.toml"
    assert main(["identify", str(tmp_path / "dive.csv"), "-o", str(written)]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.startswith("Assumed: there is no rov.toml, so the vehicle is taken for bluerov2, because it is the ")
    assert "its mass of 11.5 kg" in first
    (heave,) = [line for line in lines if re.match("- heave: (usable|do not use)", line)]
    assert "The mass and the thrusters are assumed." in heave
    vehicle = load_vehicle(written)
    assert vehicle.sources["m_rov"] == "Assumed, as in bluerov2: Wu (2018)"
    assert vehicle["height"] == 0.254, "the base has a surface, which no fit knows"
    assert vehicle.provenance
    assert {*vehicle.provenance.inputs} == {"bluerov2", "dive.csv"}
    assert not (tmp_path / "rov.toml").exists()


@pytest.mark.parametrize(
    ("title", "files", "words"),
    [
        (
            "u_bow [1],u_stern [1]",
            ["a.csv"],
            "no vehicle that ships has the thrusters bow and stern: name a vehicle file by --base",
        ),
        ("depth [m]", ["a.csv"], "no log has commands of thrusters: name a vehicle file by --base, or describe"),
        ("u_1 [1]", ["a.csv", "b/a.csv"], "is not beside"),
    ],
)
def test_logs_that_do_not_tell_the_vehicle_are_refused_in_one_line(
    title: str, files: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = 0.1 * np.arange(60.0)
    for name in files:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        columns = [np.sin(n + time) for n, _ in enumerate(title.split(","))]
        table(path, f"time [s],{title},heave velocity [m/s]", time, *columns, time)
    assert main(["identify", *(str(tmp_path / name) for name in files)]) == 2
    (line,) = [one for one in capsys.readouterr().err.splitlines() if one.startswith("rov-fmu: /")]
    assert words in line


def _check_is_the_same(vehicle: Vehicle, path: Path) -> None:
    """Check that the vehicle of the result is that of its file, whose numbers have meaningful digits."""
    written = load_vehicle(path)
    assert replace(written, provenance=None) == replace(vehicle, provenance=None)
    numbers = [*vehicle.coefficients.values(), *vehicle.command_range, *chain(*vehicle.intervals.values())]
    assert all(x == float(f"{x:.6g}") for x in numbers + [row.error for row in vehicle.estimates.values()])
    assert all(r == round(r, 6) != 0.0 for row in vehicle.estimates.values() for r in row.correlation.values())
    ((name, content),) = (
        origin(rov_fmu.load(replace(vehicle, provenance=written.provenance)))[0].items()
        - origin(replace(written, provenance=None, file=None))[0].items()
    )
    assert name.endswith(".toml")
    assert content == path.read_bytes()
