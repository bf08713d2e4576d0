"""What the terminal gets: text of strangers is escaped where it is printed, and long work shows its progress."""

import io
import re
from dataclasses import dataclass
from pathlib import Path
from time import sleep

import pytest
from rich.progress import Progress, TextColumn

from rov_fmu.io.messages import InputError, print_message
from rov_fmu.process import exit_code
from rov_fmu.report.console import console, paragraph, print_end, print_table, table
from rov_fmu.report.progress import Parts, StudyParts, parts

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
    display = Progress(TextColumn("{task.description}", markup=False), console=out)
    shown = Parts(display)
    shown.begin(FOREIGN)
    shown.print(FOREIGN)
    out.print(display.make_tasks_table(display.tasks))
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.file.getvalue())  # Rich's own
    assert all(character.isprintable() for line in text.split("\n") for character in line), ascii(text)
    assert text.count(SHOWN) == 9
    assert not re.search("^rov-fmu: forged", text, re.MULTILINE)
    assert "two" in text, "a header of two lines"


def test_messages_and_ends_escape_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    print_message(f"rov-fmu: warning: {FOREIGN}")
    print_end([Path(FOREIGN)], FOREIGN)

    def fail() -> None:
        raise InputError(FOREIGN)

    assert exit_code("rov-fmu", fail, {InputError: 2}) == 2
    out, err = capsys.readouterr()
    assert err.splitlines() == [f"rov-fmu: warning: {SHOWN}", f"rov-fmu: {SHOWN}"]
    assert out == f"Wrote '{SHOWN}'. Next: {SHOWN}\n"


def test_only_these_places_print() -> None:
    """One prints messages. The others are an example, write a text file, or print help and a schema."""
    root = Path(__file__).parents[2] / "rov_fmu"
    prints = re.compile(r"(?<![\w.])(?<!def )(?:print|Console|click\.echo)\(|std(?:out|err)\.write\(")
    found = [
        path.relative_to(root).as_posix()
        for path in sorted(root.rglob("*.py"))
        for _ in prints.findall(path.read_text(encoding="utf-8"))
    ]
    assert found == ["__init__.py", "bridges/sitl.py", "bridges/sitl.py", "cli.py", "cli.py", "io/messages.py"]


# ---- The progress of long work ---------------------------------------------------------------------------------------


@dataclass
class Runs:
    """The progress of a study."""

    done: int
    total: int = 12_000
    failed: int = 0
    dashboard: str = "http://localhost"


def test_a_pipe_gets_a_line_again_and_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where the work tells no progress, and of a study that is continued."""
    monkeypatch.setattr("rov_fmu.report.progress._EVERY", 0.05)
    with parts() as shown:
        study = StudyParts(shown)
        sleep(0.12)
        study.update(Runs(6_000))
        study.update(Runs(7_200, failed=2))
        sleep(0.12)
    sleep(0.12)
    text = capsys.readouterr().err
    assert "rov-fmu: starting the workers (0 s so far)" in text
    assert "rov-fmu: starting the workers: done in 0.1 s" in text
    found = re.findall(r"^rov-fmu: [\d,]+ runs/s, 2 failed, 7,200/12,000 runs \(0 s so far\)$", text, re.MULTILINE)
    assert 1 <= len(found) <= 3, "none after the end"
    sleep(0.1)
    assert not capsys.readouterr().err
