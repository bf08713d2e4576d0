"""Every command that writes a file, and functions that run commands in this process or in another."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY

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
_TUNE = ["tune", str(VIDEORAY), "--axis", "heave", "--command", "0.3", "--v-ss", "0.2"]


@dataclass(frozen=True)
class Command:
    """A command that writes a file."""

    name: str
    """The name of the file that it writes."""
    arguments: Callable[[Path], Sequence[str]]
    """A function that returns the arguments for the path of that file."""

    def run(self, target: Path) -> int:
        """Run the command in this process, and return its exit code."""
        return main(list(self.arguments(target)))


COMMANDS = {
    "the FMU": Command("rov.fmu", lambda path: ["build", str(BARE), "--platform", "host", "--force", "-o", str(path)]),
    "its OSP description": Command(
        "bare_OspModelDescription.xml",
        lambda path: [
            "build",
            str(BARE),
            "--platform",
            "host",
            "--osp",
            "--force",
            "-o",
            str(path.with_name("rov.fmu")),
        ],
    ),
    "the page that flies": Command("fly.html", lambda path: ["fly", str(BARE), "--force", "-o", str(path)]),
    "the model for Gazebo": Command(
        "bare.sdf", lambda path: ["export", str(BARE), "--to", "sdf", "--force", "-o", str(path)]
    ),
    "the vehicle": Command("rov.toml", lambda path: ["identify", str(FEW_TESTS), "--force", "-o", str(path)]),
    "the report": Command("report.html", lambda path: ["identify", str(FEW_TESTS), "--force", "--report", str(path)]),
    "the tuned vehicle": Command("tuned.toml", lambda path: [*_TUNE, "--force", "-o", str(path)]),
}


def without_progress(err: str) -> str:
    """Return what a command printed on stderr, without the lines about parts and runs that are done."""
    is_done = r": done in [\d.]+ s|so far(?:, about .* left)?\)|[\d,]+/[\d,]+ runs, .*"
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


def run_elsewhere(
    commands: Sequence[tuple[Command, Path]], folder: Path, prefix: Sequence[str] = (), **how: Any
) -> list[tuple[int, str]]:
    """Run commands in another process with its temporary files in a folder. Return their exit codes and errors."""
    arguments = json.dumps([list(command.arguments(target)) for command, target in commands])
    result = subprocess.run(
        [*prefix, sys.executable, "-c", _DRIVER, arguments],
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
