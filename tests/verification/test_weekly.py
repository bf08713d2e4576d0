"""All that does not run at each submission has one command, and a job in the weekly workflow."""

import sys
from importlib.util import find_spec

import pytest
import yaml
from click.testing import CliRunner

from tests.commands import ROOT
from verification import weekly


def test_each_part_has_a_job_and_commands_that_are_there() -> None:
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "weekly.yml").read_text(encoding="utf-8"))
    assert workflow["jobs"]["part"]["strategy"]["matrix"]["part"] == [*weekly.PARTS]
    commands = [command.split() for _, some in weekly.PARTS.values() for command in some]
    assert ["pytest", "-rs", "-m", "weekly"] in commands
    for program, *arguments in commands:
        assert find_spec(arguments[1] if program == "python" else program)


def test_a_part_that_fails_is_told_and_the_others_run(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = f"{sys.executable} -c pass"
    parts = {
        "bad": ("what fails", ['python -c "raise SystemExit(3)"', ran]),
        "well": ("what is well", ['python -c "pass"']),
    }
    monkeypatch.setattr(weekly, "PARTS", parts)
    done = CliRunner().invoke(weekly.main, [])
    assert done.exit_code == 1
    assert ran not in done.output, "what follows a failure in a part does not run"
    rows = done.output.splitlines()[-2:]
    assert [row.split(None, 1)[1] for row in rows] == ["bad: what fails, FAILED", "well: what is well"]
    assert CliRunner().invoke(weekly.main, ["nothing"]).exit_code == 2
