"""Compile C with the compiler of the ziglang package: the FMU's libraries, the page's module, and the engine."""

import importlib.util
import os
import platform
import signal
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fat_macho import FatWriter

from rov_fmu.io.interrupts import UNINTERRUPTED, cleaned_up, temporary_folder
from rov_fmu.io.messages import brief
from rov_fmu.io.paths import FMU_SRC

C_SOURCES = FMU_SRC / "c"
UNITY_FILE = "fmu.c"
MODULE_SOURCES = FMU_SRC / "live"
MODULE_FILE = "module.c"
ENGINE_FILE = FMU_SRC / "engine" / "engine.c"
# The numbers and their cost depend on these flags: the same rounding on every processor, no errno in the mathematics.
# LLVM's vectorizer of straight-line code is off, because it does not terminate for the equations of a few vehicles.
C_FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fno-slp-vectorize")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
_LIBRARY_FLAGS = ("-g0", "-s", "-shared", "-fvisibility=hidden", "-fno-asynchronous-unwind-tables")
# -Os makes the module a third smaller. A step then takes a microsecond, and a page draws an image every 16 ms.
# -Wno-unused-function: the C files contain functions that no page calls.
_MODULE_FLAGS = (
    *("-Os", "-target", "wasm32-freestanding", "-msimd128", "-nostdlib", "-I.", "-Wl,--no-entry"),
    *("-Wno-unused-function", MODULE_FILE),
)


class BuildError(Exception):
    """An error that ends a build. Its text is one line, possibly followed by the compiler's own output."""


class OptionError(BuildError):
    """An option with a wrong value, or options that cannot be combined."""


@dataclass(frozen=True)
class Platform:
    """A platform: its folder in binaries/, and the compiler's options for it."""

    folder: str
    """The folder in FMI 3.0 (section 2.5.1.4.1). In FMI 2.0 (section 2.3) it is the platform's name."""
    suffix: str
    """The suffix of a shared library."""
    target: str
    """The compiler's name for the platform."""
    flags: Sequence[str] = ()
    also: str | None = None
    """A second target. In FMI 2.0, the libraries of both are joined into one universal file."""

    def targets(self, fmi: int) -> list[str]:
        """Return the targets of the library for a version of FMI."""
        return [self.target, *([self.also] if self.also and fmi == 2 else [])]


# GLIBC 2.17 is as old as CentOS 7 (2012). Pages of 4 KiB keep the file small.
_LINUX = ("-lm", "-Wl,-z,max-page-size=4096", "-Wl,-z,common-page-size=4096")
_APPLE_SILICON = "aarch64-macos.11.0"

# In FMI 2.0, FMPy and FMILibrary load darwin64 on Apple Silicon too. Therefore the file for darwin64 has code for both
# processors. The standard also has a separate folder (2.3). No known importer looks for x86_64-linux, -windows or
# -darwin in FMI 2.0. On Apple Silicon, FMPy, FMILibrary since 3.0.2, CasADi and the Rust crates load aarch64-darwin in
# FMI 3.0.
PLATFORMS: dict[str, Platform] = {
    "linux64": Platform("x86_64-linux", ".so", "x86_64-linux-gnu.2.17", _LINUX),
    "linux32": Platform("x86-linux", ".so", "x86-linux-gnu.2.17", _LINUX),
    "aarch64-linux": Platform("aarch64-linux", ".so", "aarch64-linux-gnu.2.17", _LINUX),
    "win64": Platform("x86_64-windows", ".dll", "x86_64-windows-gnu"),
    "win32": Platform("x86-windows", ".dll", "x86-windows-gnu"),
    "darwin64": Platform("x86_64-darwin", ".dylib", "x86_64-macos.11.0", also=_APPLE_SILICON),
    "aarch64-darwin": Platform("aarch64-darwin", ".dylib", _APPLE_SILICON),
}

OTHER_NAMES = {
    **{platform.folder: name for name, platform in PLATFORMS.items()},
    **{"linux": "linux64", "arm-linux": "aarch64-linux", "arm64-linux": "aarch64-linux"},
    **dict.fromkeys(("windows", "win"), "win64"),
    **dict.fromkeys(("macos", "mac", "osx", "darwin", "apple"), "darwin64 or aarch64-darwin"),
}
"""Other names of the platforms, such as those of FMI 3.0, and the names used here for them."""


def host_platform(fmi: int = 2) -> str | None:
    """Return the platform that importers of this version look for on this machine, or None if it is not supported."""
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    return {
        ("Linux", "x86_64"): "linux64",
        ("Linux", "aarch64"): "aarch64-linux",
        ("Windows", "x86_64"): "win64",
        ("Darwin", "x86_64"): "darwin64",
        ("Darwin", "aarch64"): "darwin64" if fmi == 2 else "aarch64-darwin",
    }.get((platform.system(), processor))


def compiler() -> list[str]:
    """Return the C compiler's command. Raises BuildError when it is not installed."""
    zig = "zig.exe" if os.name == "nt" else "zig"
    return [str(_package_folder("ziglang", "the C compiler is missing: pip install ziglang") / zig), "cc"]


def fmi_headers() -> Path:
    """Return the folder with the FMI headers, which come with FMPy. Raises BuildError when it is not installed."""
    return _package_folder("fmpy", "the package fmpy, which has the FMI headers, is not installed") / "c-code"


def _package_folder(package: str, missing: str) -> Path:
    """Return the folder of a package without importing it. Raises BuildError with the text `missing`."""
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise BuildError(missing)
    return Path(spec.origin).parent


def compile_all(
    platforms: Sequence[str],
    sources: Mapping[str, str],
    identifier: str,
    on_done: Callable[[str], None] = lambda _: None,
    fmi: int = 2,
) -> dict[str, bytes]:
    """Compile sources (file name to text) for all platforms in parallel, and return the bytes of the libraries.

    Raises BuildError. No process and no file is left behind when it is interrupted or fails.
    """
    return _side_by_side({name: partial(_compile, name, sources, identifier, fmi) for name in platforms}, on_done)


def compile_module(sources: Mapping[str, str]) -> bytes:
    """Compile sources (file name to text) to the WebAssembly module of a page. Raises BuildError."""
    return _side_by_side({MODULE_FILE: partial(_compile_module, sources)})[MODULE_FILE]


def engine_flags() -> list[str]:
    """Return the compiler's arguments for the engine. They are those of the FMU, so the numbers are the same."""
    name = host_platform(fmi=3)
    target = ["-target", PLATFORMS[name].target] if name else ["-mcpu=baseline"]
    libraries = PLATFORMS[name].flags if name else ("-lm",)
    return [*target, *C_FLAGS, *_LIBRARY_FLAGS, *WARNINGS, "-Wno-unused-function", ENGINE_FILE.name, *libraries]


def compile_engine(sources: Mapping[str, str]) -> bytes:
    """Compile sources (file name to text) to the engine's library for this machine. Raises BuildError."""
    return _side_by_side({ENGINE_FILE.name: partial(_compile_engine, sources)})[ENGINE_FILE.name]


def _side_by_side(
    work: Mapping[str, Callable[["_Compilers"], bytes]], on_done: Callable[[str], None] = lambda _: None
) -> dict[str, bytes]:
    """Run compilations in parallel and return their results by name. Raises BuildError."""
    compilers = _Compilers()
    try:
        with ThreadPoolExecutor(os.cpu_count()) as pool, cleaned_up(compilers.end):
            jobs = {pool.submit(job, compilers): name for name, job in work.items()}
            for job in as_completed(jobs):
                job.result()
                on_done(jobs[job])
            return {name: job.result() for job, name in jobs.items()}
    except OSError as error:
        raise BuildError(f"cannot compile: {error.strerror or error}") from error


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill a compiler, with the processes that it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


class _Compilers:
    """The compilers that are running. A thread waits for each of them."""

    def __init__(self) -> None:
        self._running: set[subprocess.Popen[bytes]] = set()
        self._ended = False

    def end(self) -> None:
        """Kill the compilers, with the processes that they have started, and start no more."""
        with UNINTERRUPTED:
            self._ended = True
            for process in self._running:
                _kill(process)

    def run(self, command: Sequence[str], folder: str) -> tuple[int, str]:
        """Run a compiler, and return its exit code and output.

        When this returns, no process writes into the folder any more.
        """
        with UNINTERRUPTED:
            if self._ended:
                raise BuildError("interrupted")
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # so that the compiler's own child processes can be killed with it
            )
            self._running.add(process)
        try:
            output, _ = process.communicate()  # waits for the compiler's child processes too
        finally:
            with UNINTERRUPTED:
                self._running.remove(process)
        return process.returncode, output.decode(errors="replace").strip()


@contextmanager
def _folder_of(sources: Mapping[str, str]) -> Iterator[str]:
    """Provide a temporary folder with these files (file name to text)."""
    with temporary_folder("fmu-") as folder:
        for file, text in sources.items():
            Path(folder, file).write_text(text, encoding="utf-8")
        yield folder


def _compile_module(sources: Mapping[str, str], compilers: _Compilers) -> bytes:
    with _folder_of(sources) as folder:
        command = [*compiler(), *C_FLAGS, "-g0", "-s", *WARNINGS, *_MODULE_FLAGS, "-o", "module.wasm"]
        code, output = compilers.run(command, folder)
        if code != 0:
            raise BuildError(f"the compiler failed for the page's module\n{output}")
        return Path(folder, "module.wasm").read_bytes()


def _compile_engine(sources: Mapping[str, str], compilers: _Compilers) -> bytes:
    with _folder_of(sources) as folder:
        code, output = compilers.run([*compiler(), *engine_flags(), "-o", "engine.library"], folder)
        if code != 0:
            raise BuildError(f"the C compiler failed for the engine: {brief(output)}")
        return Path(folder, "engine.library").read_bytes()


def _compile(name: str, sources: Mapping[str, str], identifier: str, fmi: int, compilers: _Compilers) -> bytes:
    target_platform = PLATFORMS[name]
    with _folder_of(sources) as folder:
        library = Path(folder, f"{identifier}{target_platform.suffix}")
        install_name = (f"-Wl,-install_name,@rpath/{library.name}",) if library.suffix == ".dylib" else ()
        slices = []
        for target in target_platform.targets(fmi):
            command = [
                *(*compiler(), "-target", target),
                *C_FLAGS,
                *_LIBRARY_FLAGS,
                *WARNINGS,
                *(f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX" for version in (2, 3)),
                *("-isystem", str(fmi_headers())),  # without warnings about the headers
                UNITY_FILE,
                *target_platform.flags,
                *install_name,
                *("-o", library.name),
            ]
            code, output = compilers.run(command, folder)
            if code != 0:
                raise BuildError(f"{name}: the compiler failed for {target}\n{output}")
            slices.append(library.read_bytes())
        if len(slices) > 1:
            universal = FatWriter()  # type: ignore[no-untyped-call]
            for part in slices:
                universal.add(part)
            universal.write_to(str(library))
        return library.read_bytes()
