"""A fresh virtual environment, in which nothing of a checkout can be imported."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from rov_fmu.c.compile import compiler

_PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")


@dataclass(frozen=True)
class Environment:
    """A fresh virtual environment."""

    folder: Path

    @property
    def bin(self) -> Path:
        """The folder of its programs."""
        return self.folder / ("Scripts" if os.name == "nt" else "bin")

    @property
    def python(self) -> str:
        """Its interpreter."""
        return str(self.bin / "python")

    def run(self, *command: str | Path, where: Path, stderr: int | None = None) -> str:
        """Run a program of this environment, with no other on the path, in a folder; return what it prints."""
        path = {"PATH": str(self.bin), "PYTHONSAFEPATH": "1"}
        program = [str(self.bin / command[0]), *map(str, command[1:])]
        return subprocess.run(
            program, cwd=where, env=os.environ | path, stdout=subprocess.PIPE, stderr=stderr, text=True, check=True
        ).stdout


def environment(folder: Path, *requirements: str | Path, python: str = sys.executable) -> Environment:
    """Make a virtual environment of a Python with the requirements installed.

    It has no pip of its own, and its modules are not compiled, because most of them are never imported. If its C
    compiler has the version of the one here, it is replaced by a link to that, because at another place a compiler
    first builds the C libraries of all platforms again, which takes minutes.
    """
    subprocess.run([python, "-m", "venv", "--without-pip", folder], check=True)
    command = [sys.executable, *_PIP, "--python", str(folder), "install", "--no-compile", *map(str, requirements)]
    subprocess.run(command, check=True, cwd=folder)
    for own in folder.glob(f"lib/python3*/site-packages/ziglang-{version('ziglang')}.dist-info"):
        shutil.rmtree(own.with_name("ziglang"))
        own.with_name("ziglang").symlink_to(Path(compiler()[0]).parent, target_is_directory=True)
    return Environment(folder)
