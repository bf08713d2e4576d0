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
def test_what_fails_a_test_is_killed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    file, before = "rov_fmu/equation/alone.py", "from dataclasses import dataclass"
    monkeypatch.setattr(mutation, "tests_of", lambda _: ["tests/equation/test_alone.py"])
    text = (ROOT / file).read_text(encoding="utf-8")
    mutants = [
        mutation.Mutant(file, 1, before, after, text.replace(before, after)) for after in (f"{before}  # same", "1 / 0")
    ]
    assert mutation.run(mutants, 1) == mutants[:1]
    assert "2/2 killed" in capsys.readouterr().out
