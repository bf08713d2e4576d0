"""The gate of new tests: it finds those that pass on the product of an older commit."""

import subprocess
from pathlib import Path

import pytest

from verification import new_tests

_PYPROJECT = '[tool.pytest.ini_options]\naddopts = "-q -m \'not long\'"\nmarkers = ["long: x"]\n'
_OLD = "import pytest\nfrom product import LIMIT\n\n\n@pytest.mark.long\ndef test_old():\n    assert LIMIT\n"
_NEW = f"""import os, subprocess, sys, time
{_OLD}

@pytest.mark.parametrize("limit", [1, 2], ids=["a ü[", "2"])
def test_limit(limit):
    assert limit == LIMIT


def test_in_a_child_process():
    child = [sys.executable, "-c", "from product import LIMIT; print(LIMIT)"]
    assert subprocess.run(child, cwd="/", capture_output=True, check=True).stdout == b"2\\n"


def test_that_crashes():
    os._exit(3 if LIMIT == 1 else 0)


def test_that_waits():
    time.sleep(60 if LIMIT == 1 else 0)


def test_without_a_fixture(missing): ...


def test_skipped():
    pytest.skip()


@pytest.mark.long
def test_long(): ...
"""


@pytest.mark.long
def test_new_tests_that_pass_on_the_old_product_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(name: str, text: str) -> None:
        (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / name).write_text(text, encoding="utf-8")

    def git(*arguments: str) -> None:
        author = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", *author, *arguments], cwd=tmp_path, check=True)

    monkeypatch.setattr(new_tests, "ROOT", tmp_path)
    write("pyproject.toml", _PYPROJECT)
    write("product.py", "LIMIT = 1\n")
    write("tests/test_limit.py", _OLD)
    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "old")
    assert new_tests.outcomes("HEAD", "not long", 2) == {}
    write("product.py", "LIMIT = 2\nMORE = 3\n")
    write("tests/test_limit.py", _NEW)
    write("tests/test_more.py", "from product import MORE\n\n\ndef test_more(): ...\n")
    write("tests/sub/conftest.py", "import more\n")
    write("tests/sub/test_sub.py", "def test_sub(): ...\n")
    write("tests/frozen/test_frozen.py", "def test_frozen(): ...\n")
    write("more.py", "")
    in_file = {
        "limit[2]": "failed",
        "limit[a \\xfc[]": "passed",
        "in_a_child_process": "failed",
        "that_crashes": "failed",
        "that_waits": "failed",
        "without_a_fixture": "failed",
        "skipped": "skipped",
        "long": "passed",
    }
    others = {"tests/test_more.py::test_more": "not imported", "tests/sub/test_sub.py::test_sub": "not imported"}
    expected = {f"tests/test_limit.py::test_{name}": outcome for name, outcome in in_file.items()} | others
    assert new_tests.outcomes("HEAD", "", 2, longest=5) == expected
