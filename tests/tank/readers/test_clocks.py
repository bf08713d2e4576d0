"""Clocks that restart, and times in every unit."""

from math import nan
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.clocks import restart_rows, restarts, usual_delay
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import Source
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.content import content_of
from tests.tank.readers.motion import BLUEROV2
from tests.tank.readers.test_mavlink import N


def test_a_simulation_that_is_reset_is_two_pieces() -> None:
    """Its clock restarts after 30 s, and the arrivals go on. A topic without times has those of their arrival."""
    stamps = [*range(100, 130), *range(100, 120)]
    times = [(float(stamp), 500.0 + n) for n, stamp in enumerate(stamps)]
    messages = {Source("/timed"): times, Source("/untimed"): [(nan, arrival + 0.1) for _, arrival in times]}
    given = {source: [(*pair, {"x": float(n)}) for n, pair in enumerate(pairs)] for source, pairs in messages.items()}
    content = content_of("a", given, {"P": [(510.0, 7.0)]})
    assert [piece.since for piece in content.pieces] == [0.0, 30.0]
    for piece, first, count in zip(content.pieces, (0, 30), (30, 20), strict=True):
        timed, untimed = piece.topics
        assert timed.time.tolist() == [100.0 + n for n in range(count)]
        assert timed.fields["x"].tolist() == [float(first + n) for n in range(count)]
        assert untimed.time == pytest.approx(timed.time + 0.1)
    assert content.pieces[0].parameters.told["P"][0] == pytest.approx([110.0])
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


def csv(folder: Path, header: str, times: list[str]) -> Path:
    path = folder / "dive.csv"
    rows = [f"{time},{30 * (n > 9)},{0.01 * n}" for n, time in enumerate(times)]
    path.write_text("\n".join([f"{header},u_5 [%],depth [m]", *rows]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "times"),
    [
        ("%time", [f"{1_669_909_208_877_428_140 + 200_000_000 * n}" for n in range(N)]),
        ("time [s]", [f"2026-05-01T23:59:{50 + n // 5:02d}.{2 * (n % 5)}Z" for n in range(50)]),
        ("stamp", [f"2026-05-01 10:00:{n // 5:02d},{200 * (n % 5):03d}000111+02:00" for n in range(N)]),
    ],
    ids=["rostopic echo -p", "ISO 8601", "ISO 8601 with an offset"],
)
def test_times_in_any_unit(header: str, times: list[str], tmp_path: Path) -> None:
    if header == "stamp":  # decimal commas need another separator
        times = [time.replace(",", ".") for time in times]
    names, _ = names_of(BLUEROV2, RovTables(columns={"stamp": "time [s]"}))
    (log,) = read_logs(csv(tmp_path, header, times), BLUEROV2, names)
    assert log.commands is not None
    assert np.diff(log.commands.rows) == pytest.approx(0.2 * np.ones(len(times) - 1), abs=1e-6)
