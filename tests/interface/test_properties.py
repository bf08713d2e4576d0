"""The function of each command that has one writes the bytes that the command writes."""

from collections.abc import Callable
from pathlib import Path

import pytest

import rov_fmu
from rov_fmu.bridges.sdf import gazebo_model
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.identify.tuning import Target, tune
from rov_fmu.io.output import sealed
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import write_tuned
from tests.commands import BARE, FEW_TESTS, WRITING
from tests.conftest import without_page

ALONE = {("simulate", "plot"), ("fly", "output"), ("sitl", "log"), ("sitl", "parameters")}
ALONE |= {("study", "output"), ("identify", "report"), ("inspect", "report")}
ALONE |= {("export", "folder"), ("system", "output")}
"""What only commands write, or what the tests of studies and bridges compare."""


def _simulated(path: Path) -> None:
    run = rov_fmu.load(BARE).simulate(10.0)
    rows = zip(run.time.tolist(), *(values.tolist() for values in run.values()), strict=True)
    lines = [",".join(["time", *run.names]), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _tuned(path: Path) -> None:
    found = tune(load_vehicle(VIDEORAY), HEAVE, [Target("V_ss", 0.3, 0.2)]).vehicle
    values = {name: found[name] for name in ("alpha_w", "beta_w")}
    write_tuned(VIDEORAY, path, values, "Tuned to V_ss = 0.2 at 30%")


FUNCTIONS: dict[tuple[str, str], Callable[[Path], object]] = {
    ("build", "output"): lambda path: rov_fmu.load(BARE).build(path, platforms="host"),
    ("simulate", "output"): _simulated,
    ("export", "output"): lambda path: path.write_text(
        sealed(gazebo_model(rov_fmu.load(BARE)).text, "export"), encoding="utf-8"
    ),
    ("identify", "output"): lambda path: rov_fmu.identify_folder(FEW_TESTS, output=path),
    ("tune", "output"): _tuned,
}


@pytest.mark.parametrize("key", FUNCTIONS, ids=" ".join)
def test_both_interfaces_write_the_same_bytes(key: tuple[str, str], tmp_path: Path) -> None:
    command, function = (tmp_path / name / WRITING[key].name for name in ("command", "function"))
    for path in (command, function):
        path.parent.mkdir()
    with without_page():
        assert WRITING[key].run(command) == 0
        FUNCTIONS[key](function)
    assert command.read_bytes() == function.read_bytes()


def test_every_command_has_its_function_or_is_alone() -> None:
    assert FUNCTIONS.keys() | ALONE == WRITING.keys()
