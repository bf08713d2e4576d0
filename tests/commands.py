"""Every command that writes a file, and functions that run commands in this process or in another."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote, split
from typing import Any

import click
import pytest

from rov_fmu.cli import _commands, main
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY

Capsys = pytest.CaptureFixture[str]
ROOT = Path(__file__).parent.parent
REFIT = SHIPPED["videoray_refit"]
TESTS = REFIT.parent / "tank_tests"
"""The tank tests that ship."""
FEW_TESTS = ROOT / "tests" / "frozen" / "tank_tests" / "tadpole"
"""Tank tests of a single axis, which are identified in a second."""
FROZEN_REFIT = ROOT / "tests" / "frozen" / "vehicles" / "videoray_refit" / "videoray_refit.toml"
"""The refit of an earlier version, whose numbers stay."""
BARE = ROOT / "verification" / "fuzzing" / "bare.toml"
"""A vehicle that builds quickly, with one axis and one thruster."""
ALONE = re.sub(r"^(data|pictures) = .*\n", "", VIDEORAY.read_text(encoding="utf-8"), flags=re.M)
"""The VideoRay's vehicle file without references to the folders of its data and pictures."""


@dataclass(frozen=True)
class Command:
    """A command that writes a file."""

    name: str
    """The name of the file that it writes."""
    line: str
    """The command line, in which {f} is the folder of that file, and {fmu} an FMU."""

    def arguments(self, target: Path, *more: str, fmu: str = "") -> list[str]:
        """Return the words of the command line for the path of that file, and further words."""
        paths = {f"{{f}}/{self.name}": str(target), "{f}": str(target.parent), "{fmu}": fmu}
        words = split(self.line)
        for name, path in paths.items():
            words = [word.replace(name, path) for word in words]
        return [*words, *more]

    def run(self, target: Path) -> int:
        """Run the command in this process, which may replace any file, and return its exit code."""
        return main(self.arguments(target, "--force"))


FILES = {
    (name, str(parameter.name)): max(parameter.opts, key=len)
    for name, command in _commands.commands.items()
    for parameter in command.params
    if isinstance(parameter.type, click.Path) or parameter._custom_shell_complete  # which completes vehicles
}
"""The longest form of each argument and option of the command line that names a file."""
_BARE, _FEW = quote(str(BARE)), quote(str(FEW_TESTS))
_SYSTEM = quote(str(ROOT / "tests" / "bridges" / "system" / "current.toml"))
_TUNE = f"tune {quote(str(VIDEORAY))} --axis heave --command 0.3 --v-ss 0.2"
WRITING = {
    ("build", "output"): Command("rov.fmu", f"build {_BARE} --platform host -o {{f}}/rov.fmu"),
    ("simulate", "output"): Command("run.csv", f"simulate {_BARE} -o {{f}}/run.csv"),
    ("simulate", "plot"): Command("run.svg", f"simulate {_BARE} --plot {{f}}/run.svg"),
    ("fly", "output"): Command("fly.html", f"fly {_BARE} -o {{f}}/fly.html"),
    ("sitl", "log"): Command("log.csv", "sitl bluerov2 --port 0 --duration 0.01 --log {f}/log.csv"),
    ("sitl", "parameters"): Command("rov.parm", "sitl bluerov2 --port 0 --duration 0.01 --parameters {f}/rov.parm"),
    ("export", "output"): Command("rov.sdf", f"export {_BARE} --to sdf -o {{f}}/rov.sdf"),
    ("export", "folder"): Command("allocation.yaml", "export bluerov2 --to allocation -o {f}"),
    ("system", "output"): Command("my.ssp", f"system {_SYSTEM} -o {{f}}/my.ssp"),
    ("study", "output"): Command("study.html", "study {f}/plan.toml -o {f}"),
    ("identify", "output"): Command("rov.toml", f"identify {_FEW} -o {{f}}/rov.toml"),
    ("identify", "report"): Command("report.html", f"identify {_FEW} --report {{f}}/report.html"),
    ("inspect", "report"): Command("page.html", f"inspect {_FEW} --report {{f}}/page.html"),
    ("tune", "output"): Command("tuned.toml", f"{_TUNE} -o {{f}}/tuned.toml"),
}
"""What each option of a command writes. A study, an exported folder and the files beside an FMU name their files."""
READING = {
    ("build", "vehicle"): "build videoray.toml",
    ("list", "folder"): "list tests",
    ("simulate", "vehicle"): "simulate videoray.toml",
    ("simulate", "commands"): "simulate videoray.toml --input points.csv",
    ("fly", "vehicle"): "fly videoray.toml",
    ("fly", "against"): "fly videoray --against refit.toml",
    ("fly", "recording"): "fly videoray --recording points.csv",
    ("sitl", "vehicle"): "sitl videoray.toml",
    ("export", "vehicle"): "export --to sdf videoray.toml",
    ("export", "gains"): "export videoray --to ardusub-gains --gains points.csv",
    ("prove", "fmu"): "prove videoray.fmu",
    ("system", "plan"): "system current.toml",
    ("study", "plan"): "study study.json",
    ("identify", "tests"): "identify tests/steady_surge.csv",
    ("identify", "base"): "identify tests --base videoray.toml",
    ("inspect", "tests"): "inspect tests/steady_surge.csv",
    ("tune", "vehicle"): "tune videoray.toml --axis heave --command 0.3 --v-ss 0.2",
    ("tune", "points"): "tune videoray.toml --axis heave --points points.csv",
}
"""What each argument and option reads that names a file: the last word, in a folder with these files."""
COMMANDS = {key: command for key, command in WRITING.items() if key[0] not in ("prove", "study") and key[1] != "folder"}
"""Those that write one file into any folder, and read none there."""


def without_progress(err: str) -> str:
    """Return what a command printed on stderr, without the lines about parts and runs that are done."""
    is_done = r": done in [\d.]+ s|so far(?:, about .* left)?\)|so far: .*|[\d,]+/[\d,]+ runs, .*"
    return re.sub(rf"^rov-fmu: .*(?:{is_done})\n", "", err, flags=re.M)


_DRIVER = """
import contextlib, io, json, sys
from rov_fmu.cli import main
ends = []
for arguments in json.loads(sys.argv[1]):
    error = io.StringIO()
    with contextlib.redirect_stderr(error), contextlib.redirect_stdout(io.StringIO()):
        code = main(arguments)
    ends.append((code, error.getvalue()))
print(json.dumps(ends))
"""


def python(*arguments: str, **how: Any) -> str:
    """Run Python in another process, in the checkout by default, and return what it prints. It must end well."""
    given = {"cwd": ROOT, "capture_output": True, "text": True, **how}
    ran = subprocess.run([sys.executable, *arguments], check=False, **given)
    assert ran.returncode == 0, ran.stderr
    return str(ran.stdout)


def run_elsewhere(
    commands: Sequence[Sequence[str]], folder: Path, prefix: Sequence[str] = (), **how: Any
) -> list[tuple[int, str]]:
    """Run command lines in another process with its temporary files in a folder. Return their exit codes and errors."""
    result = subprocess.run(
        [*prefix, sys.executable, "-c", _DRIVER, json.dumps(commands)],
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(folder)},
        capture_output=True,
        text=True,
        check=True,
        **how,
    )
    return [(code, error) for code, error in json.loads(result.stdout)]


def start(
    arguments: Sequence[str], *, environment: Mapping[str, str] | None = None, **how: Any
) -> subprocess.Popen[str]:
    """Start a command line in another process."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.Popen(
        [sys.executable, "-m", "rov_fmu", *arguments],
        cwd=ROOT,
        env=inherited | dict(environment or {}),
        stderr=subprocess.PIPE,
        text=True,
        **how,
    )


def endless_compiler(folder: Path) -> dict[str, str]:
    """The environment in which a build uses a compiler that never ends.

    The compiler has a child of its own, whose process number it writes into the file `number` of this folder.
    """
    zig = folder / "endless" / "ziglang" / "zig"
    zig.parent.mkdir(parents=True)
    zig.with_name("__init__.py").touch()
    zig.write_text(
        f"#!/bin/sh\nsleep 6000 &\necho $! > '{folder}/n'\nmv '{folder}/n' '{folder}/number'\nwait\n", encoding="utf-8"
    )
    zig.chmod(0o755)
    return {"PYTHONPATH": str(zig.parent.parent)}
