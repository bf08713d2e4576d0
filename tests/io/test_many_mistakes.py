"""Of many mistakes in a TOML file, the first ten are printed and the others counted, in a limited time."""

import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.io.messages import FileError
from rov_fmu.io.toml_file import read_toml
from tests.commands import BARE, TESTS, Capsys, without_progress
from tests.often import often

SECONDS_PER_MISTAKE = 4e-4
"""A limit for the processor time, ten times what is needed. If every mistake had a line, it would take 9e-4 s."""


def _vehicle(folder: Path) -> tuple[Path, list[str]]:
    path = Path(shutil.copy(BARE, folder / "vehicle.toml"))
    return path, ["export", str(path), "--to", "urdf"]


def _rov(folder: Path) -> tuple[Path, list[str]]:
    tests = Path(shutil.copytree(TESTS, folder / "tests"))
    return tests / "rov.toml", ["identify", str(tests)]


def _plan(folder: Path) -> tuple[Path, list[str]]:
    path = folder / "plan.toml"
    path.write_text('vehicle = "videoray"\nstop_time = 1.0\nstep = 0.1\nruns = 4\n[figures]\nend = "u[-1]"\n')
    return path, ["study", str(path), "-o", str(folder / "results")]


@often("number", 10_000, 20_000, 100_000)
@pytest.mark.parametrize("file", [_vehicle, _rov, _plan])
def test_many_unknown_tables(
    file: Callable[[Path], tuple[Path, list[str]]], number: int, tmp_path: Path, capsys: Capsys
) -> None:
    path, command = file(tmp_path)
    with path.open("a", encoding="utf-8") as text:
        text.writelines(f"[t{n}]\n" for n in range(number))
    began = time.process_time()
    assert main(command) == 2
    assert time.process_time() - began < SECONDS_PER_MISTAKE * number
    lines = without_progress(capsys.readouterr().err).splitlines()
    assert all(line.startswith(f"rov-fmu: {path}: t{n}: there is no such key") for n, line in enumerate(lines[:10]))
    assert lines[10:] == [f"rov-fmu: {path}: {number - 10} more mistakes"]


def test_a_toml_file_that_is_too_large_is_not_read(tmp_path: Path, capsys: Capsys) -> None:
    path, command = _vehicle(tmp_path)
    with path.open("ab") as file:
        file.truncate(30_000_000)
    assert main(command) == 2
    assert capsys.readouterr().err == f"rov-fmu: {path}: has 30,000,000 bytes; at most 2,000,000 are read\n"


# What a parser would take minutes or gigabytes for, in less than 2 MB: its cost grows with the square of the parts.
_PARTS = 50_000
_KEY = ".".join(["a"] * _PARTS)
BOMBS = {
    "a dotted key": f"{_KEY} = 1",
    "quoted parts": ".".join(["'='"] * _PARTS) + " = 1",
    "spaces between parts": " . ".join(['"."'] * _PARTS) + " = 1",
    "a heading": f"[{_KEY}]",
    "a list of tables": f"[[{_KEY}]]",
    "an inline table": "x = { " + _KEY + " = 1 }",
    "behind strings of several lines": "x = { a = \"\"\"\n\"\"\"\"\", b = '''\n''''', "
    + ".".join(["a"] * _PARTS)
    + " = 1 }",
    "behind an escaped quote": r'x = { a = "\"", ' + _KEY + " = 1 }",
    "many headings": "\n".join(f"[a{n}.b.c.d.e.f.g.h.i.j.k]" for n in range(_PARTS)),
    "nested tables": "x = " + "{a = " * _PARTS,
    "nested lists": "x = " + "[" * _PARTS,
    "a string without an end": 'x = "' + "\\\\" * 900_000,
    "quotes": '"' * 1_900_000,
    "backslashes and quotes": 'x\\"""\n' * 300_000,
}


@pytest.mark.parametrize(
    ("file", "bomb"), [*((_vehicle, bomb) for bomb in BOMBS), (_rov, "a dotted key"), (_plan, "nested tables")]
)
def test_a_toml_file_cannot_exhaust_the_machine(
    file: Callable[[Path], tuple[Path, list[str]]], bomb: str, tmp_path: Path, capsys: Capsys
) -> None:
    path, command = file(tmp_path)
    path.write_text(f"{BOMBS[bomb]}\n", encoding="utf-8")
    began = time.process_time()
    assert main(command) == 2
    assert time.process_time() - began < 2.0
    (line,) = without_progress(capsys.readouterr().err).splitlines()
    assert line.startswith(f"rov-fmu: {path}: ")
    assert len(line) < 500


def test_dots_in_texts_and_lists_are_no_parts_of_keys(tmp_path: Path) -> None:
    path = tmp_path / "some.toml"
    dots = "." * 1000
    texts = f'a = "{dots}"  # {dots}\n"b.{dots}".c.d = """{dots}\n{dots}"""\ne = {[0.5] * 1000}\nf = \'{dots}\'\n'
    path.write_text(texts, encoding="utf-8")
    assert read_toml(path, FileError).keys() == {"a", f"b.{dots}", "e", "f"}
    path.write_text(".".join(["a"] * 20) + " = 1\n", encoding="utf-8")
    assert read_toml(path, FileError)
