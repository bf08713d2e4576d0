"""Sensors that stop changing before a log ends: they are told, and the rest of the recording is used."""

import numpy as np
import pytest

from rov_fmu.identify.findings import SEVERITY, result_sentences
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Channel
from rov_fmu.tank.quality import checked_log
from tests.tank.logs import channel, log, used

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
    found = checked_log(log(None, *measured, voltage))
    start = "29.9" if value is None else "30"
    assert result_sentences(found.findings) == (
        f"a.csv: depth and heading do not change any more after {start} s, although the log ends at 59.9 s. Did the "
        "log or the sensor stop? Their later values are left out",
    )
    assert {SEVERITY[finding.kind] for finding in found.findings} == {"Warnings"}
    for quantity in ("depth", "heading"):
        assert used(found, quantity).samples[0][-1] == pytest.approx(float(start) - 0.1)
    assert used(found, "voltage").values.tolist() == voltage.values.tolist()


@pytest.mark.parametrize(
    ("noise", "step", "first", "second", "end", "start"),
    [
        pytest.param(0.01, 0.001, 99, 99, 60, None, id="with noise"),
        pytest.param(0.01, 0.001, 30, 99, 60, None, id="one sensor"),
        pytest.param(0.01, 0.001, 32, 30, 60, 29.9, id="within 2 s"),
        pytest.param(0.01, 0.001, 30, 32.1, 60, None, id="at different times"),
        pytest.param(0.01, 0.001, 48, 48, 60, 47.9, id="for a fifth of the log"),
        pytest.param(0.01, 0.001, 48.1, 48.1, 60, None, id="for less than a fifth of the log"),
        pytest.param(0.01, 0.001, 9.8, 9.8, 14.9, 9.7, id="for 5 s"),
        pytest.param(0.01, 0.001, 9.8, 9.8, 14.7, None, id="for less than 5 s"),
        pytest.param(0.001, 0.01, 99, 99, 60, None, id="at rest"),
        pytest.param(0.006, 0.01, 30, 30, 60, None, id="steps of the resolution"),
    ],
)
def test_sensors_that_froze_together_are_told(
    noise: float, step: float, first: float, second: float, end: float, start: float | None
) -> None:
    """Two sensors freeze at two times; where they are said to be frozen, it is from the start on."""
    told = [] if start is None else [[start]]
    check(told, *(frozen(noisy(n, noise, step), at)[: round(10 * end)] for n, at in ((1, first), (2, second))))


def check(told: list[list[float]], *measured: Array) -> None:
    """Check the numbers of the findings about frozen sensors, and that sensors that may be right stay as they are."""
    given = channels(*measured)
    found = checked_log(log(None, *given))
    assert [pytest.approx([finding.words["start"]]) for finding in found.findings] == told
    assert told or [*found.channels] == given


def test_motions_without_visible_noise_may_end() -> None:
    """They are smooth, or each sample stands three times."""
    check([], frozen(np.sin(TIME), 30.0), frozen(np.cos(TIME), 30.0))
    check([], *(np.repeat(frozen(noisy(seed, 0.01, 0.001), 10.0)[:200], 3) for seed in (1, 2)))
