"""The comparison of known results: it accepts what a fit on another processor ends with, and refuses a real change."""

import re

import pytest

from tests.frozen.comparison import differences
from tests.frozen.known import FOLDER, RESULTS

EFFECTS = "Effect | Of | Value | 95 % from | to | Unit | Evidence | Result |\n"
VARIABLES = "Name | Of | Causality | Variability | Start | Unit | Min | Max |\n"
REPEATED = {
    "J is minimised to 0.3": (f"{EFFECTS}Load | heave | 2.0 | 1.4 | 2.6 | N | {{}} | reported |", "0.1", "−0.2"),
    "a value beside 0": (f"{EFFECTS}Load | yaw | {{}} | −0.0033 | 0.0033 | N | −9.4 | reported |", "0", "0.000067"),
    "a value of a file": ('F_0 = {{ value = {}, unit = "N", interval = [-0.302, 0.235] }}', "-0.021", "-0.012"),
    "a correlation": ("b = {{ error = 0.3, correlation = {{ a = {} }} }}", "0.000131", "-0.002"),
    "a number without an interval": ("steady at {} m/s", "0.997875", "1.000"),
    "a power of ten": ("a limit of {} N", "1.2·10⁻⁵", "1.3·10⁻⁵"),
}
"""A line of a fit, and two numbers in it that are the same."""
CHANGED = {
    "the sign of an evidence": (f"{EFFECTS}Load | heave | 2.0 | 1.4 | 2.6 | N | {{}} | reported |", "0.6", "−0.6"),
    "an exponent": ("a limit of {} N", "4.4·10⁻⁵", "4.4·10⁻⁶"),
    "another table": (
        f"{EFFECTS}\n## Variables\n{VARIABLES}a | b | c | fixed | 1.00 | N | {{}} | 2.00 |",
        "0.50",
        "0.70",
    ),
    "a word": ("the load is {}", "known", "unknown"),
    "one number more": ("the load is {}", "2.0", "2.0 to 3.0"),
}
"""A line of a fit, and two texts in it that are not the same."""


@pytest.mark.parametrize(("line", "kept", "now"), REPEATED.values(), ids=REPEATED)
def test_numbers_that_another_processor_ends_with_are_the_same(line: str, kept: str, now: str) -> None:
    for one, other in ((kept, now), (now, kept)):
        assert differences(line.format(one), line.format(other), is_fit=True) == []
        assert differences(line.format(one), line.format(other), is_fit=False), "only a fit ends elsewhere"


@pytest.mark.parametrize(("line", "kept", "now"), CHANGED.values(), ids=CHANGED)
def test_a_change_is_a_difference(line: str, kept: str, now: str) -> None:
    for one, other in ((kept, now), (now, kept)):
        found = differences(line.format(one), line.format(other), is_fit=True)
        assert any(row.startswith("+") and other in row for row in found)


def test_numbers_that_no_fit_ends_with_repeat_but_for_rounding() -> None:
    assert differences("0.1 and 4.4·10⁻¹⁶", "0.10000000000000002 and −1.6·10⁻¹⁵", is_fit=False) == []
    assert differences("0.1 and 4.4·10⁻⁹", "0.1 and 4.5·10⁻⁹", is_fit=False)


@pytest.mark.parametrize("name", [name for name in RESULTS if name.startswith("identify")])
def test_every_line_of_a_result_tells_that_its_numbers_changed(name: str) -> None:
    """They all grow by a tenth, and by two of the last digit, where rounding would hide it."""
    kept = (FOLDER / name).read_text(encoding="utf-8")
    now = re.sub(r"\d+(\.\d+)?", _larger, kept)
    told = {row[1:] for row in differences(kept, now, is_fit=True) if row.startswith("+")}
    assert {*now.splitlines()} - {*kept.splitlines()} <= told


def _larger(number: re.Match[str]) -> str:
    decimals = len(number[0].partition(".")[2])
    return f"{1.1 * float(number[0]) + 2.0 * 10.0**-decimals:.{decimals}f}"
