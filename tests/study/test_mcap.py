"""A run of a study as MCAP: its kept outputs, and its place."""

from pathlib import Path

import pytest

import rov_fmu
from rov_fmu import Results
from rov_fmu.cli import main
from rov_fmu.io.messages import InputError
from tests.bridges.test_mcap import messages

PLAN = """vehicle = "bluerov2_heavy"
stop_time = 2.0
step = 0.1
runs = 3
seed = 1
[inputs]
u_5.steps = [[0.0, 0.3]]
[vary]
m_rov.uniform = [12.0, 15.0]
[keep]
outputs = ["x", "y", "z", "phi", "theta", "psi", "F_5"]
every = 0.1
[figures]
end = "z[-1]"
"""


@pytest.mark.long
def test_a_run_is_written_by_its_number(tmp_path: Path, scheduler: str, capsys: pytest.CaptureFixture[str]) -> None:
    plan, folder = tmp_path / "plan.toml", tmp_path / "results"
    plan.write_text(PLAN, encoding="utf-8")
    given = ["study", str(plan), "-o", str(folder), "--scheduler", scheduler]
    assert main([*given, "--mcap", "2"]) == 0
    own = Results(folder).trajectories([2])
    found = messages((folder / "run-2.mcap").read_bytes())
    assert [values for _, values in found["/outputs"]] == own.drop(columns=["run", "t"]).to_dict("records")
    assert [stamp for stamp, _ in found["/outputs"]] == [100_000_000 * n for n in range(21)]
    last, pose = own.iloc[-1], found["/pose"][-1][1].pose
    assert [pose.position.x, pose.position.y, pose.position.z] == [last.y, last.x, -last.z]
    with pytest.raises(InputError, match="of one run of a study"):
        rov_fmu.load("bluerov2_heavy").to_mcap(Results(folder).trajectories())
    assert main([*given, "--mcap", "9"]) == 2
    assert "--mcap 9: there is no such run with outputs" in capsys.readouterr().err
    assert not (folder / "run-9.mcap").exists()
