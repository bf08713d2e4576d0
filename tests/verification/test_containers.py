"""A study over a container that another tool made: its rows are those of the FMU inside."""

import json
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from rov_fmu import Results, run_study
from tests.folders import beside
from verification.interoperability.importers import HERE, IMPORTERS

PLAN = """stop_time = 4.0
step = 0.1
runs = 24
seed = 3
[inputs]
u_l.ramps = [[0.0, 0.0], [1.0, 0.5], [2.0, 0.5], [2.0, -0.2]]
u_r = 0.3
[vary]
alpha_u.normal = { mean = 1.1, sd = 0.1 }
m_rov.uniform = [6.0, 7.0]
V_N.values = [0.0, 0.2]
[figures]
final_x = "final(x)"
drift = "mean(out['der(x)'])"
[keep]
outputs = ["u", "psi"]
"""


def _done(fmu: Path, folder: Path) -> Results:
    plan = folder / f"{fmu.stem}.toml"
    plan.write_text(f'fmu = "{beside(fmu, folder)}"\n{PLAN}', encoding="utf-8")
    return run_study(plan, folder / f"results of {fmu.stem}", workers=1)


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
        "input": [[name, inside.name, name] for name in ("u_l", "u_r", "V_N", "alpha_u", "m_rov")],
        "output": [[inside.name, name, name] for name in ("u", "psi", "x", "der(x)")],
    }
    (tmp_path / "container.json").write_text(json.dumps(container), encoding="utf-8")
    program = Path(tool.command_line(tools)[0]).with_name("fmucontainer")
    subprocess.run(
        [
            program,
            "-container",
            "container.json",
            "-fmi",
            f"{fmi}",
            "-no-auto-link",
            "-no-auto-input",
            "-no-auto-output",
        ],
        cwd=tmp_path,
        check=True,
    )
    own, contained = _done(inside, tmp_path), _done(tmp_path / "container.fmu", tmp_path)
    assert {*own.runs.status} == {"done"}
    pd.testing.assert_frame_equal(contained.runs, own.runs, rtol=1e-11, atol=1e-13)
    pd.testing.assert_frame_equal(contained.trajectories(), own.trajectories(), rtol=1e-11, atol=1e-13)
