"""Whole results stay: descriptions, model cards, pages, models for Gazebo and ROS, and what commands print."""

import subprocess
from pathlib import Path

import pytest

from tests.cli.test_wheel import interpreter, lowest
from tests.commands import ROOT
from tests.frozen.known import FOLDER, LONG, RESULTS, difference, now
from verification.fresh_environment import environment

TOOLS = ("filelock", "hypothesis", "mpmath", "pytest", "pytest-xdist")
"""What these tests import besides the dependencies."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.weekly if name in LONG else ()) for name in RESULTS]
)
def test_a_known_result_stays(name: str) -> None:
    """If it has to change, `python -m tests.frozen` writes it anew, and prints the difference for review."""
    if name.startswith("study"):
        pytest.importorskip("dask")
    assert difference(name, now(name)) == []


def test_every_file_is_a_known_result() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {*RESULTS}


@pytest.mark.weekly
def test_the_fits_end_alike_with_the_lowest_versions(tmp_path: Path) -> None:
    python = next(filter(None, map(interpreter, ("3.10", "3.11", "3.12", "3.13"))), None)
    if python is None:
        pytest.skip("the lowest versions of NumPy and SciPy have no packages for the interpreters here")
    own = environment(tmp_path / "venv", "-r", lowest(tmp_path, "dependencies"), *TOOLS, python=python).python
    which = ["-n", "0", "-p", "no:cacheprovider", "-m", "", "-k", "known and identify", __file__]
    ran = subprocess.run([own, "-m", "pytest", *which], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-3000:]
