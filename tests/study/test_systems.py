"""Studies of systems: component.variable names what varies, what is kept, and what a figure is of."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from rov_fmu import run_study
from rov_fmu.bridges.system.companion import companion
from rov_fmu.bridges.system.connections import Connection
from rov_fmu.bridges.system.ssp import Component, System, ssp_content
from rov_fmu.cli import main
from rov_fmu.fmu.archive import archive
from rov_fmu.io.messages import FileError
from rov_fmu.study.system import read_system
from tests.commands import without_progress
from tests.often import spread

PLAN = """
system = "my.ssp"
stop_time = 3.0
step = 1.0
runs = 6
[vary]
"a.speed".uniform = [0.5, 1.5]
[set]
"b.seabed" = 4.0
[inputs]
"a.z".steps = [[0, 0.0], [2, 0.5]]
[keep]
outputs = ["b.V_N"]
[figures]
first = "final(a.V_N)"
begin = "b.V_N[0]"
second = "b.V_N[-1]"
by_name = 'out["b.V_N"][-1]'
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a system of two currents, V = speed (1 - z / seabed), where z of the second is 2 V of the first."""
    fmu, values = companion("current"), {"speed": 1.0, "exponent": 1.0, "seabed": 1.0}
    parts = {name: Component(f"{name}.fmu", fmu, values, inputs, ["V_N"]) for name, inputs in (("a", []), ("b", ["z"]))}
    system = System("two", parts, 1.0, 3.0, [Connection(("a", "V_N"), ("b", "z"), 2.0)])
    (tmp_path / "my.ssp").write_bytes(ssp_content(system))
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    return tmp_path


def test_a_study_of_a_system_has_the_rows_of_the_closed_form(
    folder: Path, scheduler: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", str(folder / "plan.toml"), "-o", str(folder / "results"), "--scheduler", scheduler]) == 0
    # a.z falls by half in the last step, which b hears of after the run; with half the step, half a step before.
    assert "one run is trustworthy: half the step changes a.V_N by 0.0% of its range" in capsys.readouterr().err
    page = (folder / "results" / "study.html").read_text(encoding="utf-8")
    assert "first over a.speed" in page, "what varied most with it"
    results = run_study(folder / "plan.toml", folder / "results", scheduler=scheduler)
    runs = results.runs
    assert (runs.status == "done").all()
    assert runs["a.speed"].between(0.5, 1.5).all()
    np.testing.assert_allclose(runs["first"], runs["a.speed"] * (1.0 - 0.5), rtol=1e-12)
    np.testing.assert_allclose(runs["second"], 1.0 - 0.5 * runs["a.speed"], rtol=1e-12)  # by V of a, a step before
    np.testing.assert_allclose(runs["begin"], 1.0 - 0.5 * runs["a.speed"], rtol=1e-12)  # by V of a at the start
    assert runs["second"].tolist() == runs["by_name"].tolist()
    ends = results.trajectories().query("t == 3.0")["b.V_N"]
    assert ends.tolist() == runs["second"].tolist()


WRONG = {
    '"a.speed".uniform': ('"c.speed".uniform', "vary.c.speed: the FMU has no variable 'c.speed' that is a number"),
    '"b.seabed" = 4.0': ('"b.z" = 2.0', "set.b.z = 2.0: it cannot be set"),
    '"a.z".steps': ('"b.z".steps', "inputs.b.z: is no input of the FMU; its causality is connected"),
    "final(a.V_N)": ("final(a.V_X)", "figures.first = 'final(a.V_X)': 'a.V_X' is neither a function nor a variable"),
    'system = "my.ssp"': ('system = "plan.toml"', "must be a system (SSP), and not a TOML file"),
    "runs = 6": ('vehicle = "videoray"\nruns = 6', "must have one of fmu, vehicle or system"),
}


@pytest.mark.parametrize("old", spread(WRONG, [*WRONG][::2], WRONG))
def test_what_does_not_fit_a_system_is_one_line(old: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    new, message = WRONG[old]
    (folder / "plan.toml").write_text(PLAN.replace(old, new), encoding="utf-8")
    assert main(["study", str(folder / "plan.toml"), "-o", str(folder / "results")]) == 2
    line, *others = without_progress(capsys.readouterr().err).splitlines()
    assert message in line
    assert not others


def test_a_damaged_system_is_one_line(folder: Path) -> None:
    content = (folder / "my.ssp").read_bytes()
    for damaged in (content[:1000], b"no archive"):
        (folder / "my.ssp").write_bytes(damaged)
        with pytest.raises(FileError, match="is not a system"):
            run_study(folder / "plan.toml", folder / "results")


def rename(folder: Path, old: bytes, new: bytes) -> None:
    """Replace an attribute in the structure of the system, such as the name of a component."""
    with zipfile.ZipFile(folder / "my.ssp") as packed:
        files = {name: packed.read(name) for name in packed.namelist()}
    structure = "SystemStructure.ssd"
    files[structure] = files[structure].replace(b'"%s"' % old, b'"%s"' % new)
    (folder / "my.ssp").write_bytes(archive(files))


def test_a_connection_may_have_an_offset(folder: Path) -> None:
    rename(folder, b"2.0", b'2.0" offset="0.4')
    runs = run_study(folder / "plan.toml", folder / "results", workers=1).runs
    np.testing.assert_allclose(runs["second"], 1.0 - 0.1 - 0.5 * runs["a.speed"], rtol=1e-12)


def test_the_name_of_a_component_leads_out_of_no_folder(folder: Path) -> None:
    """A stranger's system may have such names; the FMUs are unpacked into folders with numbers."""
    rename(folder, b"a", b"/a")
    model = read_system(folder / "my.ssp")
    assert "/a.V_N" in model.variables
    model.unpack(folder / "own")
    assert {path.name for path in (folder / "own").iterdir()} == {"0", "1"}
    assert not Path("/a").exists()


@pytest.mark.parametrize("name", ["a.1", "", "b"])
def test_a_component_whose_variables_have_no_name_of_their_own_is_refused(name: str, folder: Path) -> None:
    rename(folder, b"a", name.encode())
    with pytest.raises(FileError, match=rf"my.ssp: SystemStructure.ssd: line \d+: the name .*, '{name}', must not be"):
        run_study(folder / "plan.toml", folder / "results")
