"""A study over a container that another tool made: its rows are those of the FMU inside."""

import json
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from rov_fmu.study import Results, study
from tests.folders import beside
from verification.interoperability.importers import HERE, IMPORTERS

PLAN = """fmu = "{fmu}"
stop_time = 4.0
step = 0.1
runs = 6
[inputs]
u_l.ramps = [[0.0, 0.0], [1.0, 0.5], [2.0, 0.5], [2.0, -0.2]]
[vary]
alpha_u.normal = {{ mean = 1.1, sd = 0.1 }}
V_N.values = [0.0, 0.2]
[keep]
outputs = ["u", "psi"]
[figures]
drift = "mean(out['der(x)'])"
"""


def _done(fmu: Path, folder: Path) -> Results:
    plan = folder / f"{fmu.stem}.toml"
    plan.write_text(PLAN.format(fmu=beside(fmu, folder)), encoding="utf-8")
    return study(plan, folder / f"results of {fmu.stem}", workers=1)


@pytest.mark.interop
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_container_by_fmutool_gives_the_rows_of_the_fmu(
    fmi: int, tmp_path: Path, videoray_fmu: Path, videoray3_fmu: Path
) -> None:
    tool, tools = next(importer for importer in IMPORTERS if importer.name == "fmucontainer"), HERE / ".tools"
    if not tool.is_installed(tools):
        pytest.skip("python -m verification.interoperability --install python")
    inside = Path(shutil.copy(videoray_fmu if fmi == 2 else videoray3_fmu, tmp_path / "inside.fmu"))
    container = {
        "name": "container.fmu",
        "step_size": 0.1,
        "fmu": [inside.name],
        "input": [[name, inside.name, name] for name in ("u_l", "V_N", "alpha_u")],
        "output": [[inside.name, name, name] for name in ("u", "psi", "der(x)")],
    }
    (tmp_path / "container.json").write_text(json.dumps(container), encoding="utf-8")
    program = Path(tool.command_line(tools)[0]).with_name("fmucontainer")
    arguments = f"-container container.json -fmi {fmi} -no-auto-link -no-auto-input -no-auto-output"
    subprocess.run([program, *arguments.split()], cwd=tmp_path, check=True)
    own, contained = _done(inside, tmp_path), _done(tmp_path / "container.fmu", tmp_path)
    assert {*own.runs.status} == {"done"}
    pd.testing.assert_frame_equal(contained.runs, own.runs, rtol=1e-11, atol=1e-13)
    pd.testing.assert_frame_equal(contained.trajectories(), own.trajectories(), rtol=1e-11, atol=1e-13)
