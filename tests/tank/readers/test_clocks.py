"""Clocks that restart, and times in every unit."""

from math import nan
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.clocks import restart_rows, restarts, usual_delay
from rov_fmu.tank.columns import Names
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import Source
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.content import Messages, content_of
from tests.tank.readers.motion import BLUEROV2


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
    assert content.findings == [
        Finding("time of arrival", file="a", names={"topics": "/untimed"}, numbers={"count": 50})
    ]


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


DATES = {
    "time [s]; 2026-05-01T23:59:50.2Z": 1777679990.2,
    "time [s]; 2026-05-01 23:59:50,200000111": 1777679990.2,
    "time [s]; 2026-05-02 01:59:50.2+02:00": 1777679990.2,
    "%time; 1777679990200000000": 1777679990.2,
}
"""Dates, in UTC if they name no offset, and what `rostopic echo -p` writes, in seconds since 1970."""


@pytest.mark.parametrize("text", DATES)
def test_times_since_1970(text: str, tmp_path: Path) -> None:
    header, date = text.split("; ")
    path = tmp_path / "dive.csv"
    path.write_text(f"{header};u_5 [%]\n{date};30\n", encoding="utf-8")
    (log,) = read_logs(path, BLUEROV2, Names(), is_part=True)
    assert log.commands is not None
    assert log.commands.rows == pytest.approx([DATES[text]], abs=1e-6)
