"""The data of the tutorials: made the same every time, small, and what a pool and a dive would give."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from examples import tank_tests


@pytest.mark.long
def test_the_command_of_the_tutorial_writes_the_same_tank_tests_every_time(tmp_path: Path) -> None:
    folder, tmp_path = tmp_path / "by command", tmp_path / "by function"
    assert CliRunner().invoke(tank_tests.main, [str(folder)], catch_exceptions=False).exit_code == 0
    tmp_path.mkdir()
    tank_tests.write_tests(tmp_path)
    first, again = ({path.name: path.read_bytes() for path in each.iterdir()} for each in (folder, tmp_path))
    assert first == again
    assert len(first) == 12
