"""Clocks that restart, and times in every unit."""

from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.clocks import first_in_each, parts_of_clock, restart_rows, restarts, usual_delay
from rov_fmu.tank.columns import ColumnNames
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import Source
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.content import Content, Messages, Piece, content_of
from tests.tank.readers.motion import BLUEROV2

N = np.arange(100)


def test_a_simulation_that_is_reset_is_two_pieces() -> None:
    """Its clock restarts after 30 s, and the arrivals go on. A topic without times has those of their arrival."""
    stamps = [*range(100, 130), *range(100, 120)]
    messages: Messages = {Source("/timed"): [], Source("/untimed"): []}
    for n, stamp in enumerate(stamps):
        for own, row in zip(messages.values(), ((float(stamp), 500.0 + n), (nan, 500.1 + n)), strict=True):
            own.append((*row, {"x": float(n)}))
    content = content_of("a", messages, {"P": [(510.0, 7.0)]})
    first, second = content.pieces
    assert (first.since, second.since) == (0.0, 30.0)
    assert first.parameters.told["P"][0] == pytest.approx([110.0])
    for piece, numbers in ((first, np.arange(30.0)), (second, np.arange(30.0, 50.0))):
        for topic, late in zip(piece.topics, (0.0, 0.1), strict=True):
            assert topic.fields["x"].tolist() == numbers.tolist()
            assert topic.time == pytest.approx(100.0 + late + np.arange(len(numbers)))
    assert content.findings == [Finding("time of arrival", file="a", words={"topics": "/untimed", "count": 50})]


@pytest.mark.parametrize(
    ("later", "rows"),
    [
        (np.arange(10.0), [40]),
        (np.arange(9.0), []),  # too few
        (10.0 + np.arange(10), [40]),
        (10.5 + 0.8 * np.arange(10), []),  # less than half of the times come again
        (np.arange(-10.0, 0.0), [40]),
        (np.tile(np.arange(14.0), 2), [40, 54]),
    ],
)
def test_a_restart_is_ten_messages_of_times_that_come_again_or_are_all_earlier(later: Array, rows: list[int]) -> None:
    before = np.append(2.0 * np.arange(20), 100.0 + np.arange(20))
    assert restart_rows(np.append(before, later)) == rows


def test_what_several_topics_show_at_once_is_one_restart() -> None:
    """The last message before it arrived at 20 s and at 20.5 s, and the first one after it at 21 s and at 20.8 s."""
    stamp = np.append(np.arange(21.0), np.arange(15.0))
    arrival = np.append(np.arange(21.0), 21.0 + np.arange(15.0))
    pairs = np.column_stack([stamp, arrival])
    other = np.column_stack([stamp, arrival + 0.5])
    other[21, 1] = 20.8
    later = np.vstack([pairs, [[np.nan, 50.0]], np.column_stack([np.arange(10.0), 60.0 + np.arange(10.0)])])
    assert restarts([pairs, np.empty((0, 2)), other]) == [20.8]
    assert restarts([pairs, later]) == [21.0, 60.0]


def test_a_delay_of_less_than_a_second_is_of_the_same_clock() -> None:
    sent = np.array([0.0, 1.0, np.nan, 3.0])
    for delay, usual in ((0.9, 0.0), (-0.9, 0.0), (1.1, 1.1), (-1.1, -1.1)):
        assert usual_delay(np.column_stack([sent, sent + delay])) == pytest.approx(usual)


FLIPPED = [1.0 * 2**bit * 1e-9 for bit in range(42, 63)]
"""What one flipped bit adds to a time in whole nanoseconds, s: from 73 minutes to 146 years."""


@pytest.mark.parametrize("shift", [*FLIPPED, *(-shift for shift in FLIPPED)])
@pytest.mark.parametrize("rate", [0.5, 10.0, 400.0])
def test_a_time_that_is_far_from_all_others_is_no_time_of_the_log(shift: float, rate: float) -> None:
    time = 1e6 + np.arange(100) / rate
    time[[30, 31]] += shift
    time[50] = np.nan
    assert np.flatnonzero(parts_of_clock(time)).tolist() == [30, 31, 50]
    assert not parts_of_clock(time)[[*range(30), 99]].any()


@pytest.mark.parametrize(
    ("time", "parts"),
    [
        (np.append(np.arange(10.0), 1.7e9 + np.arange(10.0)), [0] * 10 + [1] * 10),  # the clock was set
        (np.append(np.arange(9.0), 1.7e9 + np.arange(10.0)), [-1] * 9 + [0] * 10),  # it was set at the start
        (np.append(np.arange(9.0), 3600.0 + np.arange(10.0)), [0] * 19),  # an hour is not far
        (np.array([0.0, 1.0, 2.0, 1e9]), [0, 0, 0, -1]),  # a log of few times has its largest part
        (1e7 * np.arange(20.0), [0] * 20),  # nor are years, where all are as far
        (np.full(3, np.nan), [-1] * 3),
        (np.full(3, np.inf), [-1] * 3),
        (np.empty(0), []),
    ],
)
def test_a_log_has_a_part_for_each_setting_of_its_clock(time: Array, parts: list[int]) -> None:
    assert parts_of_clock(time).tolist() == parts


def test_topics_with_clocks_of_their_own_stay_together() -> None:
    """A driver counts since its start, and all others since 1970. Where all times are infinite, nothing is left."""
    boot, epoch = (Topic(Source(name), start + np.arange(20.0), {}) for name, start in (("a", 5.0), ("b", 1.7e9)))
    content = Content("a.mcap", [Piece([boot, epoch])])
    content.split_by_clock()
    assert [len(topic.time) for topic in content.pieces[0].topics] == [20, 20]
    assert (len(content.pieces), content.findings) == (1, [])
    content = Content("a.mcap", [Piece([replace(boot, time=np.full(20, np.inf))])])
    content.split_by_clock()
    assert [piece.topics for piece in content.pieces] == [[]]


def test_work_grows_with_the_rows_and_not_with_the_time_between_them() -> None:
    """The rows are those that a grid of times finds, which would need 10^15 of them here."""
    time = np.cumsum(np.random.default_rng(0).exponential(0.3, 500))
    grid = np.arange(time[0], time[-1], 2.0)
    assert first_in_each(time, 0.5).tolist() == np.unique(np.searchsorted(time, grid)).tolist()
    far = np.append(time, 1e15 + time)
    assert first_in_each(far, 0.5).size < 500
    assert first_in_each(np.empty(0), 1.0).size == 0


@pytest.mark.parametrize(
    ("header", "date"),
    [
        ("time [s]", "2026-05-01T23:59:50.2Z"),
        ("time [s]", "2026-05-01 23:59:50,200000111"),
        ("time [s]", "2026-05-02 01:59:50.2+02:00"),
        ("%time", "1777679990200000000"),  # as `rostopic echo -p` writes it
    ],
)
def test_times_since_1970(header: str, date: str, tmp_path: Path) -> None:
    """A date is in UTC if it names no offset."""
    path = tmp_path / "dive.csv"
    path.write_text(f"{header};u_5 [%]\n{date};30\n", encoding="utf-8")
    (log,) = read_logs(path, BLUEROV2, ColumnNames(), is_part=True)
    assert log.commands is not None
    assert log.commands.rows == pytest.approx([1777679990.2], abs=1e-6)
