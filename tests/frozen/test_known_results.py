"""Whole results stay: descriptions, model cards, pages, models for Gazebo and ROS, and what commands print."""

import pytest

from tests.frozen.known import FOLDER, LONG, RESULTS, difference, now


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
