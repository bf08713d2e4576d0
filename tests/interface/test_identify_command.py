"""The command `identify` as a function: the parts of its work and their progress."""

from itertools import pairwise
from pathlib import Path

import pytest

from rov_fmu.interface.identify_command import identify_folder
from rov_fmu.io.messages import Progress
from tests.folders import small_folder


@pytest.mark.parametrize("with_report", [pytest.param(False, marks=pytest.mark.long), True])
def test_the_progress_names_what_is_done_and_never_goes_back(with_report: bool, tmp_path: Path) -> None:
    begun: dict[str, list[tuple[str, float]]] = {}

    def begin(name: str) -> Progress:
        begun[name] = []
        return lambda *call: begun[name].append(call)

    report = tmp_path / "report.html" if with_report else None
    folder = small_folder(tmp_path / "tests")
    identify_folder(folder, None, report, force=False, begin=begin)
    assert [*begun] == ["reading the folder", "identifying the vehicle", *["drawing the report"] * with_report]
    for calls in begun.values():
        shares = [share for _, share in calls]
        assert all(before <= after for before, after in pairwise(shares))
        assert not shares or (shares[0] == 0.0 and shares[-1] < 1.0)
    steps = [step for step, _ in begun["identifying the vehicle"]]
    assert {"reading the logs", "start 1", "all samples", "exact derivatives", "what to measure next of heave"} <= {
        *steps
    }
