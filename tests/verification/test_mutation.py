"""The mutation test: which lines it changes, and which tests it runs for them."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from verification import mutation
from verification.checkouts import ROOT, environment


def test_every_file_has_tests() -> None:
    files = mutation.files()
    assert {"rov_fmu/equation/python/step.py", "rov_fmu/identify/likelihood/objective.py", "fmu_src/c/step.c"} <= {
        *files
    }
    assert not [test for file in files for test in mutation.tests_of(file) if not (ROOT / test).exists()]
    tests = mutation.tests_of("rov_fmu/equation/alone.py")
    assert tests[0] == "tests/equation/test_alone.py", "those that import it are the first"
    assert mutation.tests_of("rov_fmu/process.py"), "every file of the product has tests"


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module that is the only file to mutate."""
    pytest.importorskip("cosmic_ray")
    monkeypatch.setattr(mutation, "ROOT", tmp_path)
    monkeypatch.setattr(mutation, "files", lambda: ["source.py"])
    mutation._mutants.cache_clear()
    return tmp_path / "source.py"


@pytest.mark.long
def test_only_code_is_mutated(source: Path) -> None:
    source.write_text(
        '"""1 + 2."""\n'
        "from dataclasses import dataclass\n"
        "@dataclass(frozen=True)\n"
        "class A:\n"
        "    x: list[1] = 3\n"
        "def f(\n"
        "    a: list[1],\n"
        ") -> list[2]:\n"
        '    raise ValueError(f"{1 + 2}")\n'
        "    return zip(a, a, strict=True)\n"
        "if TYPE_CHECKING:\n"
        "    x = 1\n"
        "b = 1 < 2\n"
    )
    mutants = [mutant for seed in range(20) for mutant in mutation.draw(seed)]
    assert {mutant.line for mutant in mutants} == {5, 13}
    assert {mutant.after.replace(" ", "") for mutant in mutants if mutant.line == 5} == {"x:list[1]=4", "x:list[1]=2"}
    assert [mutant.after for mutant in mutation.draw(1)] == [mutant.after for mutant in mutation.draw(1)]


def test_a_kept_mutant_is_found_where_its_line_is_today(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mutation, "ROOT", tmp_path)
    monkeypatch.setattr(mutation, "FILES", ("*.py",))
    (tmp_path / "a.py").write_text("x = 1\ny = 2\nx = 1\nz = 3\n")
    rows = [mutation.kept(mutation.Mutant("a.py", n, "x = 1", "x = 2", "")) for n in (1, 3)]
    assert [found.text for row in rows if (found := mutation.applied(row))] == [
        "x = 2\ny = 2\nx = 1\nz = 3\n",
        "x = 1\ny = 2\nx = 2\nz = 3\n",
    ]
    (tmp_path / "a.py").write_text("x = 1\ny = 2\n" * 3)
    alike = [mutation.applied(mutation.kept(mutation.Mutant("a.py", n, "y = 2", "y = 3", ""))) for n in (2, 4)]
    assert [found and found.line for found in alike] == [2, 4], "the neighbours are alike, and its number tells"
    (tmp_path / "a.py").write_text("\nx = 1\nw = 2\nx = 1\nz = 3\n")
    assert [mutation.applied(row) for row in rows] == [None, None], "in two places, with other neighbours"
    (tmp_path / "a.py").write_text("a = 1\n")
    (tmp_path / "b.py").write_text("y = 2\nx = 1\nz = 3\n")
    moved = mutation.applied(rows[1])
    assert moved is not None
    assert (moved.file, moved.line, moved.text) == ("b.py", 2, "y = 2\nx = 2\nz = 3\n")


@pytest.mark.long
@pytest.mark.parametrize(("limit", "code", "begun"), [(0.0, 0, ""), (2.5, -signal.SIGXCPU, "b")])
@pytest.mark.skipif(sys.platform == "win32", reason="the limits are POSIX")
def test_processor_time_ends_a_run_or_a_test(limit: float, code: int, begun: str, tmp_path: Path) -> None:
    text = """
def test_b():
    open("log", "w").write("b")
    while True: pass
"""
    (tmp_path / "test_a.py").write_text(text)
    (tmp_path / "log").touch()
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "verification.processor_time",
        "-c",
        "/dev/null",
        "test_a.py",
    ]
    own = environment(ROOT) | {"ROV_FMU_PROCESSOR_TIME": str(limit), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    assert subprocess.run(command, cwd=tmp_path, env=own, capture_output=True, check=False).returncode == code
    assert (tmp_path / "log").read_text() == begun


@pytest.mark.long
def test_verdicts_are_written_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = "rov_fmu/equation/alone.py"
    monkeypatch.setattr(mutation, "tests_of", lambda _: ["tests/equation/test_alone.py"])
    before = "from dataclasses import dataclass"
    line = 1 + (ROOT / file).read_text(encoding="utf-8").splitlines().index(before)
    mutants = [mutation.Mutant(file, line, before, after, "") for after in (f"{before}  # same", "1 / 0")]
    rows = [*map(mutation.kept, mutants), mutation.kept(mutants[0]) | {"before": "no such line"}]
    results = tmp_path / "results.csv"
    done = mutation.run_kept(results, rows)
    assert [row["verdict"] for row in done] == ["survived", "killed", "no longer applies"]
    assert mutation.read_rows(results) == done
    assert mutation.run_kept(results, rows) == done, "nothing is left to run"
