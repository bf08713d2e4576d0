"""Every command that writes a file, to run in this process or, many of them, in one other."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import build_fmu
from models.__main__ import main as models_main
from models.vehicle import VIDEORAY

from .test_experiments import TESTS

ROOT = Path(build_fmu.__file__).parent
_TUNE = ["tune", str(VIDEORAY), "--axis", "heave", "--command", "0.3", "--v-ss", "0.2"]
MAINS = {"build_fmu": build_fmu.main, "models": models_main}
REFUSED = {"build_fmu": 1, "models": 2}
"""The exit code of each where it cannot write."""


@dataclass(frozen=True)
class Command:
    """How a command is told what to write."""

    program: str
    name: str
    """Of the file that it writes."""
    arguments: Callable[[Path], Sequence[str]]
    """By the path of that file."""

    @property
    def refused(self) -> int:
        """Its exit code where it cannot write."""
        return REFUSED[self.program]

    def run(self, target: Path) -> int:
        """Run it in this process."""
        return MAINS[self.program](list(self.arguments(target)))


COMMANDS = {
    "the FMU": Command("build_fmu", "rov.fmu", lambda path: ["--platform", "host", "-o", str(path)]),
    "its OSP description": Command(
        "build_fmu",
        "videoray_OspModelDescription.xml",
        lambda path: ["--platform", "host", "--osp", "-o", str(path.with_name("rov.fmu"))],
    ),
    "the vehicle": Command("models", "rov.toml", lambda path: ["identify", str(TESTS), "-o", str(path)]),
    "the report": Command("models", "report.html", lambda path: ["identify", str(TESTS), "--report", str(path)]),
    "the tuned vehicle": Command("models", "tuned.toml", lambda path: [*_TUNE, "-o", str(path)]),
    "the figures": Command("models", "paper_figures.svg", lambda path: ["figures", str(path.parent)]),
}

_DRIVER = """
import contextlib, io, json, sys
from tests.commands import MAINS
ends = []
for program, arguments in json.loads(sys.argv[1]):
    error = io.StringIO()
    with contextlib.redirect_stderr(error), contextlib.redirect_stdout(io.StringIO()):
        code = MAINS[program](arguments)
    ends.append((code, error.getvalue()))
print(json.dumps(ends))
"""


def run_elsewhere(
    commands: Sequence[tuple[Command, Path]], folder: Path, prefix: Sequence[str] = (), **how: Any
) -> list[tuple[int, str]]:
    """Run commands in one other process, its temporary files in a folder: their exit codes and what they say."""
    asked = json.dumps([(command.program, list(command.arguments(target))) for command, target in commands])
    result = subprocess.run(
        [*prefix, sys.executable, "-c", _DRIVER, asked],
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(folder)},
        capture_output=True,
        text=True,
        check=True,
        **how,
    )
    return [(code, error) for code, error in json.loads(result.stdout)]


def start(program: Sequence[str], *, environment: Mapping[str, str] | None = None, **how: Any) -> subprocess.Popen[str]:
    """Start a command line as a process of its own."""
    script = {"build_fmu": [str(ROOT / "build_fmu.py")], "models": ["-m", "models"]}[program[0]]
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.Popen(
        [sys.executable, *script, *program[1:]],
        cwd=ROOT, env=inherited | dict(environment or {}), stderr=subprocess.PIPE, text=True, **how,
    )  # fmt: skip
