"""The same vehicle file gives the same FMU to the byte, also in another folder or with another Python."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_wheel import CONSTRAINTS, built, interpreter, pinned_environment
from tests.commands import BARE, ROOT, python
from tests.conftest import Made
from verification.fresh_environment import environment

_BUILDS = {
    "native": ("--platform", "linux64", "--platform", "win64"),
    "fmi3": ("--fmi", "3", "--platform", "linux64"),
    "pythonfmu": ("--backend", "pythonfmu"),
}
_OLDEST, _NEWEST = 10, 14  # Python 3, as pyproject.toml has it


def _built(folder: Path, flavour: str, *command: str) -> str:
    """Build a flavour with a command, and return the hash of the FMU."""
    fmu = folder / f"{flavour}.fmu"
    subprocess.run([*command, *_BUILDS[flavour], "-o", str(fmu)], check=True, capture_output=True, cwd=folder)
    return hashlib.sha256(fmu.read_bytes()).hexdigest()


_CHECKOUT = str(ROOT / "build_fmu.py")


@pytest.fixture(scope="module")
def pinned(made_once: Made, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the hashes of builds by this Python from the checkout, with the versions of constraints.txt."""
    python, folder = pinned_environment(made_once, tmp_path_factory).python, tmp_path_factory.mktemp("checkout")
    return {flavour: _built(folder, flavour, python, _CHECKOUT) for flavour in _BUILDS}


_CONTENT = """
import sys
from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.vehicle import load_vehicle
content = native_content(load_vehicle(sys.argv[1]))
sys.stdout.write(repr([*content.files.items(), *content.sources.items()]))
"""
"""A program that prints what goes into an FMU and into its compiler, in order."""


def test_the_order_of_sets_changes_no_byte() -> None:
    """Python puts texts in a set in another order in each process."""
    made = [python("-c", _CONTENT, str(BARE), env=os.environ | {"PYTHONHASHSEED": seed}) for seed in "12"]
    assert made[0] == made[1]


@pytest.mark.weekly
@pytest.mark.parametrize("order", [pytest.param(1, id="oldest"), pytest.param(-1, id="newest")])
def test_built_by_another_python_from_the_wheel(pinned: dict[str, str], tmp_path: Path, order: int) -> None:
    """The Pythons are the oldest and the newest on this machine."""
    others = [f"3.{minor}" for minor in range(_OLDEST, _NEWEST + 1) if minor != sys.version_info.minor]
    if (python := next(filter(None, map(interpreter, others[::order])), None)) is None:
        pytest.skip("there is no other Python here")
    made = environment(tmp_path / "venv", "-c", CONSTRAINTS, built("wheel", tmp_path / "dist"), python=python)
    assert {name: _built(tmp_path, name, str(made.bin / "rov-fmu"), "build") for name in _BUILDS} == pinned
