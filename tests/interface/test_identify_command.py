"""The command `identify` as a function: the parts of its work and their progress."""

from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import pytest

import rov_fmu
from rov_fmu.fmu.related import origin
from rov_fmu.interface.identify_command import identify_folder
from rov_fmu.io.messages import Progress
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.folders import small_folder


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
    identification, _ = identify_folder(folder, tmp_path / "rov.toml", report, force=False, begin=begin)
    _check_is_the_same(identification.vehicle, tmp_path / "rov.toml")
    assert [*begun] == ["reading the folder", "identifying the vehicle", *["drawing the report"] * with_report]
    for calls in begun.values():
        shares = [share for _, share in calls]
        assert all(before <= after for before, after in pairwise(shares))
        assert not shares or (shares[0] == 0.0 and shares[-1] < 1.0)
    steps = [step for step, _ in begun["identifying the vehicle"]]
    assert {"reading the logs", "start 1", "all samples", "exact derivatives", "what to measure next of heave"} <= {
        *steps
    }


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
