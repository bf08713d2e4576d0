"""Sensors that stop changing before a log ends: they are told, and the rest of the recording is used."""

import numpy as np
import pytest

from rov_fmu.identify.findings import heading, sentences
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Channel
from rov_fmu.tank.quality import checked
from tests.tank.logs import channel, commands, log, used

TIME: Array = np.arange(0.0, 60.0, 0.1)
MOVING: Array = np.minimum(TIME, 20.0)
"""A motion that ends after 20 s."""


def noisy(seed: int, noise: float, step: float) -> Array:
    """Return a motion as a sensor with noise and a resolution tells it."""
    values = 0.05 * MOVING + noise * np.random.default_rng(seed).standard_normal(len(TIME))
    return np.asarray(np.round(values / step) * step)


def frozen(values: Array, at: float, value: float | None = None) -> Array:
    """Return values that stay the same from a time on."""
    last = values[at > TIME][-1] if value is None else value
    return np.where(at > TIME, values, last)


def channels(*values: Array) -> list[Channel]:
    return [channel(name, TIME[: len(some)], some) for name, some in zip(("depth", "heading"), values, strict=True)]


@pytest.mark.parametrize("value", [None, 0.0])
def test_what_frozen_sensors_say_is_left_out(value: float | None) -> None:
    """They keep their last value, or say 0, while the voltage goes on."""
    measured = channels(*(frozen(noisy(seed, 0.01, 0.001), 30.0, value) for seed in (1, 2)))
    voltage = channel("voltage", TIME, 16.0 - 0.01 * TIME)
    found = checked(log(None, *measured, voltage))
    start = "29.9" if value is None else "30"
    assert sentences(found.findings) == (
        f"a.csv: depth and heading do not change any more after {start} s, although the log ends at 59.9 s. Did the "
        "log or the sensor stop? Their later values are left out",
    )
    assert {heading(finding) for finding in found.findings} == {"Warnings"}
    for quantity in ("depth", "heading"):
        assert used(found, quantity).samples[0][-1] == pytest.approx(float(start) - 0.1)
    assert used(found, "voltage").values.tolist() == voltage.values.tolist()


@pytest.mark.parametrize(
    "measured",
    [
        channels(noisy(1, 0.01, 0.001), noisy(2, 0.01, 0.001)),
        channels(frozen(noisy(1, 0.01, 0.001), 30.0), noisy(2, 0.01, 0.001)),
        channels(frozen(noisy(1, 0.01, 0.001), 30.0), frozen(noisy(2, 0.01, 0.001), 32.1)),
        channels(frozen(noisy(1, 0.01, 0.001), 48.1), frozen(noisy(2, 0.01, 0.001), 48.1)),
        channels(noisy(1, 0.001, 0.01), noisy(2, 0.001, 0.01)),
        channels(frozen(noisy(1, 0.006, 0.01), 30.0), frozen(noisy(2, 0.006, 0.01), 30.0)),
        channels(*(frozen(noisy(seed, 0.01, 0.001), 9.8)[:147] for seed in (1, 2))),
        channels(frozen(np.sin(TIME), 30.0), frozen(np.cos(TIME), 30.0)),
        channels(*(np.repeat(frozen(noisy(seed, 0.01, 0.001), 10.0)[:200], 3) for seed in (1, 2))),
    ],
    ids=[
        "with noise",
        "one sensor",
        "at different times",
        "for less than a fifth of the log",
        "at rest",
        "steps of the resolution",
        "for less than 5 s",
        "smooth motions",
        "samples that stand three times",
    ],
)
def test_sensors_that_may_be_right_are_used(measured: list[Channel]) -> None:
    found = checked(log(commands(TIME, {"1": 0.0 * TIME}), *measured))
    assert [*found.channels] == measured
    assert "frozen sensors" not in {finding.kind for finding in found.findings}


@pytest.mark.parametrize(("first", "second", "rows"), [(32.0, 30.0, 600), (48.0, 48.0, 600), (9.8, 9.8, 149)])
def test_sensors_that_froze_within_2_s_for_5_s_and_a_fifth_of_the_log_are_told(
    first: float, second: float, rows: int
) -> None:
    measured = channels(*(frozen(noisy(n, 0.01, 0.001), at)[:rows] for n, at in ((1, first), (2, second))))
    (found,) = checked(log(None, *measured)).findings
    assert found.kind == "frozen sensors"
    assert found.numbers["start"] == pytest.approx(min(first, second) - 0.1)
