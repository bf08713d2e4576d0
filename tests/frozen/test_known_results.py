"""Whole results stay: descriptions, model cards, models for Gazebo and ROS, and what commands print."""

import pytest

from tests.frozen.known import FOLDER, RESULTS, difference


@pytest.mark.parametrize("name", RESULTS)
def test_a_known_result_stays(name: str) -> None:
    """If it has to change, `python -m tests.frozen` writes it anew, and prints the difference for review."""
    assert difference(name) == []


def test_every_file_is_a_known_result() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {*RESULTS}
