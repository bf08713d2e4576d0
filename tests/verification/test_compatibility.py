"""The folder for fmi-standard.org keeps its rules, and the check finds what breaks them."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle
from tests.conftest import without_page
from verification.compatibility import check, write
from verification.interoperability.importers import IMPORTERS


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, videoray_fmu: Path, videoray3_fmu: Path) -> Path:
    """The folder of one vehicle, with the FMUs that other tests use, too."""

    def build(vehicle: Vehicle, path: Path, platforms: str, fmi: int) -> None:
        assert (vehicle.identifier, platforms) == ("videoray", "host")
        shutil.copy(videoray_fmu if fmi == 2 else videoray3_fmu, path)

    folder = tmp_path_factory.mktemp("compatibility")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("verification.compatibility.build", build)
        write(folder, ["videoray"], "host")
    return folder


@pytest.mark.long
@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_the_rules_are_kept_and_fmpy_agrees(written: Path, version: str) -> None:
    folder = written / version / "videoray"
    assert [*check(folder)] == []
    assert (folder / "fmpy-validate.txt").read_text(encoding="utf-8").endswith(" 0 problems\n")
    reference = np.genfromtxt(folder / "videoray_ref.csv", delimiter=",", names=True)
    assert all(np.ptp(reference[name]) > 0.01 for name in ("u", "w", "r", "x", "z", "psi"))  # every axis moves


def test_the_entry_has_the_keys_and_values_of_the_list_of_tools(written: Path) -> None:
    """Those in the table "Format" of CONTRIBUTING.md of modelica/fmi-standard.org, of 2026-06-11."""
    (entry,) = json.loads((written / "tools.json").read_text(encoding="utf-8"))
    addresses = {"url", "logo", "vendorURL", "examplesURL"}
    abilities = {"features", "platforms", "interfaces", "fmiVersions", "fmuExport", "fmuImport", "layeredStandards"}
    assert entry.keys() == {"name", "license", "vendor", "description", *addresses, *abilities}
    assert {*entry["platforms"]} <= {"macOS", "Linux", "Windows"}
    assert {*entry["interfaces"]} <= {"GUI", "CLI", "library"}
    assert not entry["description"].endswith(".")


def test_the_page_names_every_importer_with_its_version(written: Path) -> None:
    page = (written / "README.md").read_text(encoding="utf-8")
    missing = [one.title for one in IMPORTERS if f"| {one.title} {one.version} |" not in page]
    assert not missing


BROKEN = {
    "a missing file": ("videoray_in.csv", None, "this file is missing"),
    "names without quotation marks": ("videoray_ref.csv", ('"u"', "u"), "all names must be in quotation marks"),
    "an unknown variable": ("videoray_ref.csv", ('"u"', '"speed"'), "speed is no variable of the FMU"),
    "another first column": ("videoray_in.csv", ('"time"', '"t"'), "the first column must be the time"),
    "an input that is missing": ("videoray_in.csv", ('"u_l"', '"u_r"'), "must have all inputs of the FMU"),
    "another time": ("videoray_ref.opt", ("StopTime, 30", "StopTime, 31"), "must run from StartTime to StopTime"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_breaks_a_rule_is_found(written: Path, case: str, tmp_path: Path) -> None:
    file, change, expected = BROKEN[case]
    folder = shutil.copytree(written / "fmi2" / "videoray", tmp_path / "videoray")
    path = folder / file
    if change:
        path.write_text(path.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    else:
        path.unlink()
    lines = [*check(folder)]
    assert any(expected in line for line in lines), lines


def test_another_result_is_found(written: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(written / "fmi3" / "videoray", tmp_path / "videoray")
    path = folder / "videoray_ref.csv"
    rows = path.read_text(encoding="utf-8").splitlines()
    time, u, *rest = rows[100].split(",")
    rows[100] = ",".join([time, repr(float(u) + 1e-4), *rest])
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    (line,) = check(folder)
    assert line.startswith("videoray_ref.csv: u differs by 0.0001")


@pytest.mark.long
def test_all_vehicles(tmp_path: Path) -> None:
    with without_page():
        write(tmp_path, platforms="host")
    folders = sorted(tmp_path.glob("fmi*/*"))
    assert len(folders) == 2 * len(SHIPPED)
    for folder in folders:
        assert [*check(folder)] == []
