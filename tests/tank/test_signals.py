"""Times and values of commands, headings that wrap, and gaps."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Log
from rov_fmu.tank.quality import uninterrupted
from tests.tank.logs import channel, commands

STEPS: Array = np.linspace(0.0, 19.9, 200)


def test_a_heading_is_unwrapped_without_its_blanks_and_noise_beyond_its_range_is_no_second_turn() -> None:
    heading = 5.8 + 0.7 * STEPS
    values = heading % (2.0 * pi)
    values[50:55] = np.nan
    values += np.radians(2.0) * np.sign(values - pi) * (np.abs(values - pi) > 3.0)
    times, found = channel("heading", STEPS, values).unwrapped
    there = np.isfinite(values)
    assert times.tolist() == STEPS[there].tolist()
    assert found == pytest.approx(heading[there], abs=np.radians(2.1))


def test_an_angle_that_ranges_over_clearly_more_than_a_turn_is_no_wrapped_one() -> None:
    values = np.tile(np.linspace(-3.4, 3.4, 100), 2)
    assert channel("heading", STEPS, values).unwrapped[1].tolist() == values.tolist()


def test_commands_hold_for_one_more_usual_interval_and_begin_at_0() -> None:
    told = commands(np.array([3.0]), {"a": np.array([0.5])})
    assert (told.interval, told.end) == (0.0, 3.0)
    several = commands(np.array([3.0, 4.0, 6.0, 10.0]), {"a": np.array([0.1, -0.4, 0.2, 0.2]), "b": np.zeros(4)})
    assert (several.end, several.largest) == (12.0, {"a": 0.4, "b": 0.0})
    assert several.at(np.array([2.9, 3.0, 5.9]))[:, 0].tolist() == [0.0, 0.1, -0.4]


@pytest.mark.parametrize("repeats", [0, 3, 12])
def test_commands_at_any_times_are_held_while_measurements_go_on_even_if_some_repeat(repeats: int) -> None:
    random = np.random.default_rng(1)
    rows = np.cumsum(random.uniform(0.2, 4.0, 40))
    values = random.uniform(-0.5, 0.5, 40)
    for n in random.choice(np.arange(1, 40), repeats, replace=False):
        values[n] = values[n - 1]
    measured = np.arange(0.0, rows[-1] + 5.0, 0.1)
    told = commands(rows, {"a": values})
    held = told.held_while(measured)
    assert {*measured[measured >= rows[0]]} <= {*held.rows}
    assert held.at(measured).tolist() == told.at(measured).tolist()


def test_a_log_in_which_nothing_is_told_for_a_time_is_several_logs_with_all_its_samples() -> None:
    """What was commanded there is unknown. If any sensor goes on, so do the commands, of which each holds."""
    time = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(18.0, 30.0, 0.1), np.arange(33.0, 40.0, 0.1)])
    depth, speed = channel("depth", time, np.sin(time)), channel("heave velocity", time[40:], np.cos(time[40:]))
    log = Log("a.csv", commands(time, {"a": np.round(np.sin(time), 1)}), (depth, speed))
    pieces = uninterrupted(log)
    assert [piece.file for piece in pieces] == ["a.csv", "a.csv (from 18 s)", "a.csv (from 33 s)"]
    assert [finding.kind for piece in pieces for finding in piece.findings] == ["interruption"]
    for name, whole in (("depth", depth), ("heave velocity", speed)):
        parts = [part for piece in pieces if (part := piece.used(name))]
        assert np.concatenate([part.values for part in parts]).tolist() == whole.values.tolist()
    for piece in pieces:
        assert piece.commands
        assert log.commands
        assert piece.commands.at(piece.commands.rows).tolist() == log.commands.at(piece.commands.rows).tolist()
        assert piece.commands.since.min() == piece.commands.rows[0]
    goes_on = replace(log, channels=(depth, channel("heave velocity", np.arange(0.0, 40.0, 0.5), np.zeros(80))))
    assert uninterrupted(goes_on) == [goes_on]
