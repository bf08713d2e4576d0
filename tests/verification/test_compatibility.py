"""The folder for fmi-standard.org keeps its rules, and a wrong result is found."""

import json
from pathlib import Path

import fmpy
import pandas as pd
import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from tests.conftest import without_page
from verification.compatibility import options_of, write, wrong_results
from verification.interoperability.importers import IMPORTERS


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


@pytest.mark.weekly
def test_all_vehicles_keep_the_rules_and_another_result_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The keys are those in the table "Format" of CONTRIBUTING.md of modelica/fmi-standard.org, of 2026-06-11."""
    monkeypatch.setattr("verification.compatibility.VERSIONS", (3,))
    with without_page():
        write(tmp_path, platforms="host")
    folders = sorted(tmp_path.glob("fmi3/*"))
    assert len(folders) == len(SHIPPED)
    for folder in folders:
        check(folder)
    (entry,) = json.loads((tmp_path / "tools.json").read_text(encoding="utf-8"))
    addresses = {"url", "logo", "vendorURL", "examplesURL"}
    abilities = {"features", "platforms", "interfaces", "fmiVersions", "fmuExport", "fmuImport", "layeredStandards"}
    assert entry.keys() == {"name", "license", "vendor", "description", *addresses, *abilities}
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert not [one.title for one in IMPORTERS if f"| {one.title} {one.version} |" not in page]
    path = tmp_path / "fmi3" / "videoray" / "videoray_ref.csv"
    rows = path.read_text(encoding="utf-8").splitlines()
    time, u, *rest = rows[100].split(",")
    rows[100] = ",".join([time, repr(float(u) + 1e-4), *rest])
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    (line,) = wrong_results(path.parent)
    assert line.startswith("videoray_ref.csv: u differs by 0.0001")
