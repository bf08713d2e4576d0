"""The folder for fmi-standard.org keeps its rules, and a wrong result is found."""

import json
import shutil
from pathlib import Path

import fmpy
import numpy as np
import pandas as pd
import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle
from tests.conftest import without_page
from verification.compatibility import options_of, write, wrong_results
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


def check(folder: Path) -> None:
    """Check the rules for the files of an FMU in CONTRIBUTING.md of modelica/fmi-standard.org, and its results."""
    name, options = folder.name, options_of(folder)
    description = fmpy.read_model_description(str(folder / f"{name}.fmu"))
    known = {variable.name: variable.causality for variable in description.modelVariables}
    for end, most in (("ref", 10), ("in", len(known))):
        path = folder / f"{name}_{end}.csv"
        table = pd.read_csv(path)
        assert path.stat().st_size <= 1_000_000
        assert path.read_text(encoding="utf-8").startswith(",".join(f'"{column}"' for column in table) + "\n")
        first, *others = table.columns
        assert first == "time"
        assert {*others} <= known.keys()
        assert len(others) <= most
        assert not table.isna().any(axis=None)
        assert table.time.is_monotonic_increasing
        assert (table.time.iloc[0], table.time.iloc[-1]) == (options["StartTime"], options["StopTime"])
    assert {*others} == {variable for variable, causality in known.items() if causality == "input"}
    assert (folder / "fmpy-validate.txt").read_text(encoding="utf-8").endswith(" 0 problems\n")
    assert (folder / "Readme.txt").is_file()
    assert not [*wrong_results(folder)]


@pytest.mark.parametrize("version", ["fmi2", pytest.param("fmi3", marks=pytest.mark.long)])
def test_the_rules_are_kept_and_fmpy_agrees(written: Path, version: str) -> None:
    folder = written / version / "videoray"
    check(folder)
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


def test_another_result_is_found(written: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(written / "fmi3" / "videoray", tmp_path / "videoray")
    path = folder / "videoray_ref.csv"
    rows = path.read_text(encoding="utf-8").splitlines()
    time, u, *rest = rows[100].split(",")
    rows[100] = ",".join([time, repr(float(u) + 1e-4), *rest])
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    (line,) = wrong_results(folder)
    assert line.startswith("videoray_ref.csv: u differs by 0.0001")


@pytest.mark.long
def test_all_vehicles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("verification.compatibility.VERSIONS", (3,))
    with without_page():
        write(tmp_path, platforms="host")
    folders = sorted(tmp_path.glob("fmi3/*"))
    assert len(folders) == len(SHIPPED)
    for folder in folders:
        check(folder)
