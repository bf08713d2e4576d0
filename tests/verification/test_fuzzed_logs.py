"""Damaged logs and tables of every format are read, or refused in one line, within a minute and 2 GB."""

from pathlib import Path

import pytest

from rov_fmu.tank.readers.parsers import FORMATS
from tests.often import often
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import SEEDS
from verification.fuzzing import __main__ as command
from verification.fuzzing import logs
from verification.fuzzing.campaign import FindingError
from verification.fuzzing.logs import damaged, try_damaged


@often("count", 2, 15, 300)
@pytest.mark.parametrize("name", [kind.name for kind in FORMATS])
def test_a_damaged_file_is_read_or_refused_in_one_line(name: str, count: int, tmp_path: Path) -> None:
    path = SEEDS[name](tmp_path, DIVE)
    tried = try_damaged(path, range(count), tmp_path)
    assert tried.read + tried.refused == count
    assert count < 15 or name == "a file that zstd compressed" or tried.read


def test_damage_is_of_every_kind_and_can_be_done_again() -> None:
    content = bytes(range(256)) * 20
    copies = [damaged(content, seed) for seed in range(100)]
    assert copies == [damaged(content, seed) for seed in range(100)]
    assert {(len(copy) > len(content)) - (len(copy) < len(content)) for copy in copies} == {-1, 0, 1}
    assert any(content.startswith(copy) for copy in copies), "cut short"
    assert any(sum(a != b for a, b in zip(copy, content, strict=True)) == 1 for copy in copies if len(copy) == 5120)


def test_a_file_that_breaks_a_promise_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A command that fails otherwise than with a line, or takes too much memory, is a finding."""
    path = SEEDS["a CSV file"](tmp_path, DIVE)
    monkeypatch.setattr(logs, "MOST_MEMORY", 1.0)
    with pytest.raises(FindingError, match=r"dive.csv, seed 0: \d s and \d+\.\d GB"):
        try_damaged(path, [0], tmp_path)
    monkeypatch.setattr(logs, "main", lambda _: 1 / 0)
    monkeypatch.chdir(tmp_path)
    assert command.main(["--logs", "1", str(path)]) == 1
    told = capsys.readouterr().err
    assert "dive.csv, seed 0: ZeroDivisionError" in told
    assert "again with: rov-fmu inspect ./damaged.csv, in base64:" in told
    assert Path("damaged.csv").read_bytes() == damaged(path.read_bytes(), 0)
