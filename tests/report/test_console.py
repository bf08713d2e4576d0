"""What the terminal gets: text of strangers is escaped where it is printed, and long work shows its progress."""

import io
import re
from math import inf, nan
from pathlib import Path
from time import sleep

import pytest
from rich.console import Console
from rich.progress import TextColumn

from rov_fmu.io.messages import InputError, print_message
from rov_fmu.process import exit_code
from rov_fmu.report import console as terminal
from rov_fmu.report.console import console, paragraph, print_end, print_table, table
from rov_fmu.report.console_log import _drawn
from rov_fmu.report.progress import Display, Parts, StudyParts, StudyProgress, compiling, parts
from rov_fmu.report.templates import number, number_text, panel_title, pretty_unit, sentence
from rov_fmu.tank.inspection.inspection import Signal
from tests.commands import Capsys

FOREIGN = "a\x1b[31m\x9b2J\u202e[red]\nrov-fmu: forged\x07\u2028\x85\x7fb"
SHOWN = r"a\x1b[31m\x9b2J\u202e[red]\nrov-fmu: forged\x07\u2028\x85\x7fb"


@pytest.mark.parametrize("is_terminal", [False, True])
def test_tables_paragraphs_and_parts_escape_control_characters(is_terminal: bool) -> None:
    out = console()
    out.file, out._force_terminal, out.width = io.StringIO(), is_terminal, 200
    found = table(FOREIGN, "\nfirst", ["two\nlines"], [FOREIGN])
    found.add_row(FOREIGN, "1", FOREIGN)
    found.caption = FOREIGN
    print_table(found, out)
    paragraph(out, FOREIGN)
    out.print(FOREIGN)
    display = Display(TextColumn("{task.description}", markup=False), console=out)
    shown = Parts(display)
    shown.begin(FOREIGN)(FOREIGN, 0.5)
    shown.print(FOREIGN)
    out.print(display.make_tasks_table(display.tasks))
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.file.getvalue())  # Rich's own
    assert all(character.isprintable() for line in text.split("\n") for character in line), ascii(text)
    assert text.count(SHOWN) == 9
    assert not re.search("^rov-fmu: forged", text, re.MULTILINE)
    assert "two" in text, "a header of two lines"


def test_messages_and_ends_escape_control_characters(capsys: Capsys) -> None:
    print_message(f"rov-fmu: warning: {FOREIGN}")
    print_end({Path(FOREIGN): ""}, FOREIGN)

    def fail() -> None:
        raise InputError(FOREIGN)

    assert exit_code("rov-fmu", fail, {InputError: 2}) == 2
    out, err = capsys.readouterr()
    assert err.splitlines() == [f"rov-fmu: warning: {SHOWN}", f"rov-fmu: {SHOWN}"]
    assert out == f"Wrote '{SHOWN}'. Next: {SHOWN}\n"


def test_only_these_places_print() -> None:
    """One prints messages. The others are an example, write a text file, or print help, the version and a schema."""
    root = Path(__file__).parents[2] / "rov_fmu"
    prints = re.compile(r"(?<![\w.])(?<!def )(?:print|Console|click\.echo)\(|std(?:out|err)\.write\(")
    found = [
        path.relative_to(root).as_posix()
        for path in sorted(root.rglob("*.py"))
        for _ in prints.findall(path.read_text(encoding="utf-8"))
    ]
    assert found == ["__init__.py", "cli.py", "cli.py", "cli.py", "io/messages.py"]


# ---- Numbers and words -----------------------------------------------------------------------------------------------


def test_numbers_and_words_are_written_for_readers() -> None:
    for value, shown in {
        **{nan: "–", inf: "–", -0.0: "0", -12.0: "−12", 99999.5: "99999.5", 123456.75: "123457", 1 / 3: "0.333333"},
        **{
            -1e6: "−10⁶",
            1e-6: "10⁻⁶",
            2.5e7: "2.5·10⁷",
            0.0513: "0.0513",
            1.2345678: "1.2345678",
            9.87654321: "9.87654",
        },
    }.items():
        assert number(value) == shown
    assert [number(None), number(1234.5678, 3)] == ["–", "1.23·10³"]
    written = [number_text(value, "+.1%") for value in (None, nan, -0.0004, 0.1234, -inf)]
    assert written == ["–", "–", "+0.0 %", "+12.3 %", "−∞ %"]
    plain = [terminal.text(value, ".1f") for value in (None, nan, -0.04, -0.06, -inf)]
    assert plain == ["-", "-", "0.0", "-0.1", "-inf"]
    assert sentence("all 3 of -5% (-2 deg) in 3 us") == "All 3 of −5\xa0% (−2 °) in 3 µs"
    assert sentence("log_1.csv: it lacks") == "log_1.csv: it lacks"
    assert [*map(pretty_unit, ("N.m.s2/rad2", "1", "us", "deg/s"))] == ["N·m·s²/rad²", "1", "µs", "°/s"]
    assert [panel_title("time to 63 %", "s"), panel_title("force", "1")] == ["Time to 63 % (s)", "Force"]


def test_a_table_that_is_too_wide_for_a_terminal_becomes_several_with_the_first_column(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In a pipe it stays whole. What a command wrote and what to do next are two lines where one would not fit."""
    out = console()
    out.file, out._force_terminal, out._color_system, out.width = io.StringIO(), True, None, 30
    numbers = [f"number {n}" for n in range(5)]
    found = table("A title", "row", numbers, ["words"])
    found.add_row("its name", *map(str, range(90, 95)), "a text that is wrapped")
    found.caption = "A caption"
    print_table(found, out)
    lines = [line.rstrip() for line in out.file.getvalue().splitlines()]
    assert max(map(len, lines)) <= 30
    assert re.findall(r"row|number \d|words|its name|9\d|A \w+", "\n".join(lines)) == [
        *("A title", "row", "number 0", "number 1", "its name", "90", "91"),
        *("row", "number 2", "number 3", "its name", "92", "93"),
        *("row", "number 4", "words", "its name", "94", "A caption"),
    ]
    monkeypatch.setattr(terminal, "console", lambda: out)
    for out.width, words in {29: "Wrote a.fmu. Next: open a.fmu\n", 28: "Wrote a.fmu.\nNext: open a.fmu\n"}.items():
        out.file = io.StringIO()
        print_end({Path("a.fmu"): ""}, "open a.fmu")
        print_end({})
        assert out.file.getvalue() == words
    out.file, out._force_terminal = io.StringIO(), False
    print_table(found, out)
    assert " ".join(out.file.getvalue().splitlines()[-2].split()) == "its name 90 91 92 93 94 a text that is wrapped"


# ---- The progress of long work ---------------------------------------------------------------------------------------


def of_study(done: int, *, failed: int = 0) -> StudyProgress:
    """Return the progress of a study."""
    return StudyProgress(done, 12_000, failed)


def test_a_terminal_shows_the_share_or_the_count_of_each_part(capsys: Capsys) -> None:
    display = Display()
    shown = Parts(display)
    assert shown.is_shown
    shown.begin("first")("its step", 0.25)
    (first,) = display.tasks
    assert (first.description, first.completed, first.fields["count"]) == ("its step", 0.25, "25%")
    study = StudyParts(shown)
    study.update(of_study(2_000))
    assert [task.description for task in display.tasks] == ["first", "starting the study", "runs"]
    assert [task.completed for task in display.tasks] == [1.0, 1.0, 0.0]
    study.update(of_study(7_000))
    assert (display.tasks[2].completed, display.tasks[2].fields["count"]) == (0.5, "7,000/12,000 runs")
    study.update(of_study(12_000))
    assert display.tasks[2].completed == 0.999, "it is not done before it ends"
    assert not capsys.readouterr().out


def test_a_study_tells_its_rate_and_its_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("rov_fmu.report.progress.perf_counter", lambda: now[0])
    display = Display()
    study = StudyParts(Parts(display))
    for now[0], runs, words in (
        (0.0, of_study(2_000), "runs"),
        (5.0, of_study(2_100), "20 runs/s"),
        (25.0, of_study(4_500, failed=7), "100 runs/s, 7 failed"),
    ):
        study.update(runs)
        assert display.tasks[1].description == words


def test_a_pipe_gets_a_line_again_and_again(monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    """Also where the work tells no progress, and of a study that is continued."""
    monkeypatch.setattr("rov_fmu.report.progress._EVERY", 0.05)
    now = [5.0]
    monkeypatch.setattr("rov_fmu.report.progress.perf_counter", lambda: now[0])
    with parts() as shown:
        study = StudyParts(shown)
        sleep(0.12)
        now[0] = 7.0
        study.update(of_study(6_000))
        now[0] = 9.0
        study.update(of_study(7_200, failed=2))
        sleep(0.12)
    sleep(0.12)
    text = capsys.readouterr().err
    assert "rov-fmu: starting the study (0 s so far)" in text
    assert "rov-fmu: starting the study: done in 2.0 s" in text
    line = "rov-fmu: 600 runs/s, 2 failed, 7,200/12,000 runs (2 s so far, about 8 s left)\n"
    assert 1 <= text.count(line) <= 3, "none after the end"
    assert "what the workers do" not in text
    sleep(0.1)
    assert not capsys.readouterr().err


def test_what_is_left_follows_from_the_share_that_is_done(monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    """A quarter is done after 10 s, so 30 s are left."""
    now = [0.0]
    monkeypatch.setattr("rov_fmu.report.progress.perf_counter", lambda: now[0])
    shown = Parts(None)
    shown.begin("work")("a step", 0.25)
    now[0] = 10.0
    shown.print_running()
    assert "about 30 s left" in capsys.readouterr().err


def test_a_step_whose_share_is_not_known_has_neither_a_percentage_nor_a_time_left(capsys: Capsys) -> None:
    shown = Parts(None)
    shown.begin("work")("trying causes", nan)
    shown.print_running()
    assert capsys.readouterr().err == "rov-fmu: trying causes (0 s so far)\n"
    display = Display(console=Console(file=io.StringIO(), width=100))
    shown = Parts(display)
    shown.begin("work")("trying causes", nan)
    (task,) = display.tasks
    assert (task.completed, task.description, task.fields["count"]) == (0.0, "trying causes", "")
    shown.end("work")
    assert display.finished


def test_an_answer_takes_the_place_of_the_one_before(capsys: Capsys) -> None:
    """In a pipe, each has a line."""
    answers = ["heave 0.5 m/s at 50%, fits the depth to 9 cm", "heave 0.46 m/s at 50%, fits the depth to 2 cm"]
    out = io.StringIO()
    display = Display(console=Console(file=out, width=100))
    for shown in (Parts(display), Parts(None)):
        for answer in answers:
            shown.tell("heave", answer)
    assert capsys.readouterr().err == "".join(f"rov-fmu: so far: {answer}\n" for answer in answers)
    display.print(*display.get_renderables())
    assert re.findall("so far: .*", out.getvalue()) == [f"so far: {answers[-1]}"]


def test_a_pipe_gets_a_line_for_each_of_several_platforms(capsys: Capsys) -> None:
    for platforms in (["linux"], ["linux", "windows"]):
        with compiling() as (begin, done):
            begin(platforms)
            for name in platforms:
                done(name)
        found = capsys.readouterr().err
        assert re.findall(r"^rov-fmu: compiling (\w+): done in 0\.0 s$", found, re.M) == (
            platforms if platforms[1:] else []
        )


def test_equal_commands_are_drawn_level() -> None:
    """Their means differ by rounding."""
    row = Signal("u_1", "1", 0.0, 3.0, 30, 10.0, 0.24, 0.24, (), (0.24, 0.24000000000000002, nan, 0.24))
    assert _drawn(row) in ("\u2581\u2581 \u2581", "__ _")
