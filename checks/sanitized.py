"""A C program built together with the FMU's sources, under clang's sanitizers."""

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from rov_fmu.export.compile import C_FLAGS, WARNINGS, BuildError, fmi_headers

_FLAGS = (*C_FLAGS, "-g", "-fno-omit-frame-pointer", *WARNINGS)


def clang() -> str | None:
    """The compiler with its sanitizers, Debian's packages clang and libclang-rt-dev; None where one is missing."""
    command = shutil.which("clang")
    if command is None:
        return None
    found = subprocess.run([command, "-print-runtime-dir"], capture_output=True, text=True, check=True).stdout.strip()
    return command if any(Path(found).glob("libclang_rt.fuzzer*")) else None


def build_sanitized(
    sources: Mapping[str, str], program: Path, output: Path, sanitizers: str, flags: tuple[str, ...] = ()
) -> None:
    """Compile a program that includes "fmu.c" with the FMU's sources (file name to text), which go beside output.

    `sanitizers` is what -fsanitize takes: "address,undefined", "thread", "fuzzer,address,undefined". Raises
    BuildError without a compiler, CalledProcessError where it does not compile without a warning.
    """
    command = clang()
    if command is None:
        raise BuildError("clang with its sanitizers is missing: apt-get install clang libclang-rt-dev")
    folder = output.with_name(f"{output.name}.sources")
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    include = ("-I", os.fspath(folder), "-isystem", os.fspath(fmi_headers()))
    sanitize = (f"-fsanitize={sanitizers}", "-fno-sanitize-recover=all")  # every report ends the program
    subprocess.run(
        [command, *_FLAGS, *sanitize, *include, os.fspath(program), *flags, "-lm", "-o", os.fspath(output)],
        check=True,
        capture_output=True,
        text=True,
    )
