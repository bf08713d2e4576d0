"""The command of the benchmarks prints all of them."""

from pathlib import Path

import pytest
from lxml import etree

from tests.commands import python
from verification.benchmarks import taylor
from verification.benchmarks.plain_c import measurable

ROOT = Path(__file__).parent.parent.parent
in_plain_c = pytest.mark.skipif(not measurable(), reason="the C programs are written for Linux on x86-64")


@pytest.mark.weekly
@in_plain_c
def test_one_command_prints_it_all(tmp_path: Path) -> None:
    picture = tmp_path / "cost_error.svg"
    printed = python("-m", "verification.benchmarks", "--quick", "--picture", str(picture), encoding="utf-8")
    parts = ("turning", "fmi2SetReal", "RK4", "A study by two workers")
    for part in (*parts, "heyoka / ours" if taylor.installed() else taylor.NOT_INSTALLED[0]):
        assert part in printed, printed
    times_ours = next(line.split()[4] for line in printed.splitlines() if line.startswith("CVODE BDF  "))
    assert float(times_ours) > 10.0, printed
    assert etree.parse(str(picture)).getroot().tag.endswith("svg")
