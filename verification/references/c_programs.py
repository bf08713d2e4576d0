"""Build C programs and libraries with the FMU's sources, for this machine or with clang's sanitizers, and run them."""

import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rov_fmu.c.compile import C_FLAGS, WARNINGS, BuildError, compiler, fmi_headers

_HEADERS = Path(__file__).with_name("c")


def clang() -> str | None:
    """Return the path of clang; None when clang or its sanitizers (Debian: clang, libclang-rt-dev) are missing."""
    command = shutil.which("clang")
    if command is None:
        return None
    found = subprocess.run([command, "-print-runtime-dir"], capture_output=True, text=True, check=True).stdout.strip()
    return command if any(Path(found).glob("libclang_rt.fuzzer*")) else None


def compile_c(
    program: Path, output: Path, sources: Mapping[str, str] | Path, *flags: str, sanitizers: str = ""
) -> Path:
    """Compile a C file and return the path of the output.

    The file can include the FMU's sources (a folder, or file name to text), the FMI headers and the headers of
    verification/references/c. The compiler and its flags are the FMU's. `sanitizers` is an argument of -fsanitize
    ("address,undefined", "thread", "fuzzer,address,undefined"), which needs clang. Raises BuildError when there is no
    compiler, and for every warning.
    """
    command = compiler()
    if sanitizers:
        if (found := clang()) is None:
            raise BuildError("clang with its sanitizers is missing: apt-get install clang libclang-rt-dev")
        # Every report ends the program.
        command = [found, "-g", "-fno-omit-frame-pointer", f"-fsanitize={sanitizers}", "-fno-sanitize-recover=all"]
    folder = sources if isinstance(sources, Path) else output.with_name(f"{output.name}.sources")
    if not isinstance(sources, Path):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in sources.items():
            (folder / name).write_text(text, encoding="utf-8")
    include = ("-I", str(folder), "-I", str(_HEADERS), "-isystem", str(fmi_headers()))
    result = subprocess.run(
        [*command, *C_FLAGS, *WARNINGS, *include, str(program), *flags, "-lm", "-o", str(output)],
        cwd=output.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode != 0:
        raise BuildError(f"{program.name} does not compile\n{result.stderr}")
    return output


@dataclass(frozen=True)
class Ended:
    """The result of a program: the words of each line of its output, its exit code, and its error output."""

    lines: list[list[str]]
    code: int
    errors: str


def run_program(*command: str | Path, **how: Any) -> Ended:
    """Run a program. Further arguments go to subprocess.run."""
    result = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False, **how)
    return Ended([line.split() for line in result.stdout.splitlines()], result.returncode, result.stderr)
