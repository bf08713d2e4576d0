"""Texts of any length in messages, XML of a stranger, and a temporary folder that has gone."""

import shutil
from math import inf, nan
from pathlib import Path

import pytest
from jinja2 import UndefinedError
from pydantic import TypeAdapter, ValidationError

from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, brief, first_of, lines_on, only, reason_of, shown
from rov_fmu.io.reading import read_bytes, root_of_xml
from rov_fmu.io.templates import render
from rov_fmu.io.toml_file import Finite, Name, Symbol, Text, join_names


def test_long_texts_and_lists_are_cut() -> None:
    assert brief(80 * "x") == 80 * "x"
    assert brief(81 * "x") == 77 * "x" + "..."
    assert brief("\x1b" + 100 * "x") == r"\x1b" + 73 * "x" + "..."
    assert (shown(-12), shown(10**5000)) == ("-12", brief(hex(10**5000)))
    names = [f"n{n}" for n in range(22)]
    assert only("z", names) == f", only {', '.join(names[:20])}, 2 more"
    assert only("nn1", ["n1"]) == ", only n1"
    assert first_of(names * 5)[99:] == [names[11], "10 more"]
    assert join_names(names[:10]) == ", ".join(names[:10])
    assert join_names(names[:11]) == ", ".join(names[:10]) + ", ..."
    assert lines_on(Path("a"), ["b", "c", "b", ""]) == ["a: b", "a: c", "a: 1 more mistake"]
    assert lines_on(Path("a"), names[:12])[9:] == ["a: n9", "a: 2 more mistakes"]


@pytest.mark.parametrize(
    "error", [MemoryError(), EOFError(), TimeoutError(), NotImplementedError(), KeyError("x"), IndexError(), OSError()]
)
def test_no_reason_is_empty_or_the_name_of_a_class(error: Exception) -> None:
    reason = reason_of(error)
    assert " " in reason
    assert type(error).__name__ not in reason


def test_xml_of_a_stranger_contains_no_other_file(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("a password", encoding="utf-8")
    xml = f'<!DOCTYPE a [<!ENTITY b SYSTEM "{secret.as_uri()}">]><a c="d">e&b;</a>'
    root = root_of_xml(xml.encode())
    assert (root.get("c"), root.text, "password" in "".join(map(str, root.itertext()))) == ("d", "e", False)


def test_texts_and_numbers_of_files_have_limits() -> None:
    limits = {Text: 10_000, Name: 100, Symbol: 30}
    for kind, most in limits.items():
        adapter = TypeAdapter(kind)
        assert adapter.validate_python(most * "x") == most * "x"
        for wrong in ("", (most + 1) * "x", " \n", "\x07"):
            with pytest.raises(ValidationError):
                adapter.validate_python(wrong)
    for number in (inf, nan):
        with pytest.raises(ValidationError):
            TypeAdapter(Finite).validate_python(number)


def test_a_file_has_a_largest_size(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    assert read_bytes(path, most=3) == b"abc"
    with pytest.raises(FileError, match=r"has 3 bytes; at most 2 are read$"):
        read_bytes(path, most=2)


TEMPLATE = """{% for one in names %}
  {{ one | shout }}
  {% endfor %}
<a{{ {"b": "<", "c": none, "d": 0.1} | attributes }}/>
"""


def test_templates_escape_what_they_show_and_leave_no_line_of_their_own(tmp_path: Path) -> None:
    for name, first in (("a.xml.j2", "  &lt;X&gt;"), ("a.toml.j2", "  <X>")):
        (tmp_path / name).write_text(TEMPLATE, encoding="utf-8")
        text = render(name, tmp_path, names=["<x>"], shout=str.upper)
        assert text == f'{first}\n<a b="&lt;" d="0.1"/>\n'
        with pytest.raises(UndefinedError):
            render(name, tmp_path, shout=str.upper)


def test_a_temporary_folder_is_removed_at_the_second_attempt_and_may_be_gone_already(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first attempt fails, as if a thread were still writing."""
    attempts, remove = iter((False, True)), shutil.rmtree
    with temporary_folder("rov-fmu-test-") as folder:
        monkeypatch.setattr(
            shutil, "rmtree", lambda *given, **options: remove(*given, **options) if next(attempts) else None
        )
    assert not Path(folder).exists()
    monkeypatch.undo()
    with temporary_folder("rov-fmu-test-") as folder:
        shutil.rmtree(folder)
