"""The progress of long work: the time left, and the lines that a pipe gets."""

import re
from dataclasses import dataclass

import pytest
from rich.progress import Task, TaskID

from rov_fmu.report.progress import StudyParts, TimeLeftColumn, compiling, parts, per_second


def test_the_time_left_counts_down_from_the_last_known_share() -> None:
    clock = [0.0]
    column, task = TimeLeftColumn(), Task(TaskID(0), "", total=1.0, completed=0.0, _get_time=lambda: clock[0])
    task.start_time = 0.0
    shown = []
    for now, share in ((1.0, 0.0), (10.0, 0.1), (40.0, 0.1), (150.0, 0.1), (160.0, 0.8), (190.0, 0.8)):
        clock[0], task.completed = now, share
        shown.append(column.render(task).plain)
    assert shown == ["", *(f"about {left} left" for left in ("1:30", "1:00", "0:00", "0:40", "0:10"))]


def test_a_pipe_gets_a_line_for_each_platform(capsys: pytest.CaptureFixture[str]) -> None:
    with compiling(["linux64", "win64", "darwin64"]) as (begin, done):
        begin()
        for name in ("win64", "linux64", "darwin64"):
            done(name)
    lines = capsys.readouterr().err.splitlines()
    assert [re.sub(r"\d\.\d", "0", line) for line in lines] == [
        f"rov-fmu: compiling {name}: done in 0 s" for name in ("win64", "linux64", "darwin64")
    ]


def test_the_times_of_the_compilers_begin_with_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The content of the FMU takes longer than the first of them."""
    clock = iter((7.0, 7.0, 8.0, 9.0))
    monkeypatch.setattr("rov_fmu.report.progress.perf_counter", lambda: next(clock))
    with compiling(["linux64", "win64"]) as (begin, done):
        begin()
        done("linux64")
        done("win64")
    assert re.findall(r"done in (\S+) s", capsys.readouterr().err) == ["1.0", "2.0"]


@dataclass
class Runs:
    """The progress of a study."""

    done: int
    total: int = 12_000
    failed: int = 0
    dashboard: str = "http://localhost"


def test_a_pipe_gets_a_line_for_each_tenth_of_the_runs(capsys: pytest.CaptureFixture[str]) -> None:
    """Also of a study that is continued."""
    with parts() as shown:
        study = StudyParts(shown)
        for done in range(6_000, 12_001, 300):
            study.update(Runs(done, failed=done // 4_000))
    preparing, *lines = capsys.readouterr().err.splitlines()
    assert preparing.startswith("rov-fmu: starting the workers: done in ")
    counts = [re.fullmatch(r"rov-fmu: ([\d,]+)/12,000 runs, [\d,]+ runs/s, (\d) failed", line) for line in lines]
    assert [found.groups() for found in counts if found] == [
        ("7,200", "1"),
        *[("8,400", "2"), ("9,600", "2"), ("10,800", "2")],
    ]


@pytest.mark.parametrize(("rate", "words"), [(1120.4, "1,120 runs/s"), (10.0, "10 runs/s"), (0.25, "0.25 runs/s")])
def test_a_rate_is_never_written_with_an_exponent(rate: float, words: str) -> None:
    assert per_second(rate) == words
