"""A plan may come from anyone: the expressions of its figures compute, and can do nothing else."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rov_fmu.cli import main
from tests.commands import ROOT

IMPORTS = "a_module_that_only_a_hostile_plan_imports"

HOSTILE = [
    # what the evaluator of earlier versions did: files written, a module imported, the process crashed
    "array([b'0123'])[0].tofile('written')",
    "matrix.tofile(array([1.0]), 'written')",
    "float64.tofile(u[0], 'written')",
    "record.tofile(u[0], 'written')",
    "matrix.dump(u, 'written')",
    "u.tofile('written')",
    "u.dump('written')",
    f"info('x', 80, None, '{IMPORTS}')",
    'ndarray(3, "O", b"a"*24)',
    # the ways out of a sandbox of Python
    f"__import__('{IMPORTS}')",
    "open('written', 'w')",
    "eval('1')",
    "exec('x = 1')",
    "compile('1', '', 'eval')",
    "getattr(u, 'tofile')('written')",
    "().__class__.__base__.__subclasses__()",
    "(1).__class__",
    "u.__class__.__mro__[1].__subclasses__()[0]",
    "max.__globals__",
    "at.__func__.__globals__['np']",
    "V_ss.__self__",
    "(lambda: u[0])()",
    "(lambda f: f(f))(lambda f: f(f))",
    "[c for c in ().__class__.__mro__]",
    "max(x for x in u)",
    "{1: u}[1]",
    "{u[0]}",
    "(u[0],)[0]",
    "[u[0]][0]",
    "f'{u.tofile}'",
    "'{0.__class__}'.format(u)",
    "'%s' % u",
    "'a' * 10**9",
    "b'a' * 10**9",
    "(x := u)[0]",
    "(yield u)",
    "await u",
    "u[0]; u[1]",
    "import os",
    "globals()",
    "locals()['u']",
    "vars()",
    "breakpoint()",
    "input()",
    "memoryview(u)",
    "np.load('/etc/passwd')",
    "loadtxt('/etc/passwd')",
    "fromfile('/etc/passwd')",
    "genfromtxt('/etc/passwd')",
    "memmap('written', mode='w+', shape=9)",
    "save('written', u)",
    "savetxt('written', u)",
    "frompyfunc(u, 1, 1)",
    "vectorize(u)",
    "apply_along_axis(max, 0, u)",
    "set_printoptions(formatter=u)",
    "seterrcall(u)",
    "out",
    "out.__class__",
    "out.clear()",
    "out[u]",
    "out['a']['b']",
    "max",
    "abs(at)",
    # arguments that write, or call back
    "sqrt(u, u)[0]",
    "maximum(u, u, u)[0]",
    "maximum(u, u, out=u)[0]",
    "clip(u, 0, 1, u)[0]",
    "sum(u, 0, None, u)",
    "mean(u, dtype='O')",
    "max(*u)",
    "max(**u)",
    "V_ss(u, **{'start': 1})",
    "final(u, self=u)",
    # sizes and times without end
    "9**9**9**9",
    "9999999999**9999999999",
    "max(9**9**9**9, 1)",
    "1 << 10**12",
    "9" * 1900,
    "diff(u, 10**9)[0]",
    "repeat(u, 10**9)[0]",
    "tile(u, 10**9)[0]",
    "outer(u, u)[0][0]",
    "ones(10**10)[0]",
    "linspace(0, 1, 10**10)[0]",
    "arange(10**12)[0]",
    "u[:, None][0][0]",
    "u[None][0][0]",
    "u[..., 0]",
    "u[0, 0]",
    "where(where(u > 0) > 0)[0]",
    "u @ u",
    "1j * u[0]",
    "round(1, 10**9)",
    "sqrt(" * 150 + "1" + ")" * 150,
    "-" * 1900 + "1",
    "u[0]" + "+1" * 900,
]


@pytest.mark.parametrize("expression", HOSTILE, ids=lambda text: text[:60])
def test_a_hostile_plan_is_refused_in_one_line_and_does_nothing(
    expression: str,
    tmp_path: Path,
    videoray_fmu: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / f"{IMPORTS}.py").write_text("")
    shutil.copy(videoray_fmu, tmp_path / "videoray.fmu")
    (tmp_path / "plan.toml").write_text(
        'fmu = "videoray.fmu"\nstop_time = 1.0\nstep = 0.1\nsampler = "grid"\n[figures]\n'
        f"end = {json.dumps(expression)}\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["study", "plan.toml", "-o", "results"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("rov-fmu: plan.toml: figures.end = ")
    assert err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {f"{IMPORTS}.py", "videoray.fmu", "plan.toml"}
    assert IMPORTS not in sys.modules


HARMLESS = {"compile", "builtins.id", "object.__getattr__", "sys._getframe"}
"""Audit events of reading a text with `ast`, and of looking at a function's parameters."""


@pytest.mark.parametrize("count", [1500, pytest.param(10_000, marks=pytest.mark.long)])
def test_random_expressions_give_numbers_and_arrays_and_open_no_file(count: int) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "tests.study.fuzzed_figures", str(count)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    told = json.loads(run.stdout)
    assert told["events"].keys() <= HARMLESS
    assert told["computed"] > 0.1 * count
    assert told["refused"] > 0.3 * count
