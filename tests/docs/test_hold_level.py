"""The example that holds the Heavy level."""

from math import degrees, pi

from examples.hold_level import fly
from verification.references.autopilot.ardusub import Hold


def test_the_example_flies_level() -> None:
    lines: list[str] = []
    assert degrees(fly(5.0, 1.0, Hold(), lines.append)) < 35.0
    assert lines[0].startswith("   5 s:   4.1 m ahead")
    assert pi > fly(1.0, 1.0, None, lines.append) > 0.7, "the raw thrusters turn it over"
