"""What the commands print on a narrow terminal."""

import pytest

from rov_fmu.cli import main


@pytest.mark.parametrize("columns", ["80", "120"])
def test_a_narrow_terminal_loses_no_digits(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # Rich then takes the output for a terminal
    monkeypatch.setenv("COLUMNS", columns)
    assert main(["tables", "videoray"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "2.0117" in out
    assert "…" not in out
