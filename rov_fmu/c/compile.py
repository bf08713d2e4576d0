"""Compile C: the FMU's libraries, the page's module, and the engine.

The compiler is that of the ziglang package, or else a `zig`, `clang` or `cc` on the PATH. Only the one that
constraints.txt pins promises the same bytes, and only zig compiles for other machines than this one.
"""

import atexit
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

from fat_macho import FatWriter
from platformdirs import user_cache_path

from rov_fmu.io.child_process import cause, inherited, kill
from rov_fmu.io.interrupts import UNINTERRUPTED, cleaned_up, temporary_folder
from rov_fmu.io.messages import MOST, RovError, listed
from rov_fmu.io.paths import FMU_SRC, own_folder

C_SOURCES = FMU_SRC / "c"
UNITY_FILE = "fmu.c"
MODULE_SOURCES = FMU_SRC / "live"
MODULE_FILE = "module.c"
ENGINE_HEADER = FMU_SRC / "engine" / "engine.h"
VECTORS_HEADER = FMU_SRC / "engine" / "vectors.h"
ENGINE_FILE = FMU_SRC / "engine" / "engine.c"
FILTER_FILE = FMU_SRC / "engine" / "filter.c"
LANES_FILE = FMU_SRC / "engine" / "lanes.c"
FILTER_LANES_FILE = FMU_SRC / "engine" / "filter_lanes.c"
_LOCATION_FILE = FMU_SRC / "python" / "location.c"
_WINDOWS_FILE = FMU_SRC / "windows" / "library.c"
PYTHONFMU_LIBRARY = "libpythonfmu-export.so"
"""The name by which PythonFMU's library for Linux knows itself."""
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
_TIME_LIMIT = 900.0
"""The longest time of one compiler, s. Without a cache, all of them together take 15 s on two free processors."""
_CACHE_VARIABLE = "ZIG_GLOBAL_CACHE_DIR"
_NO_SPACE = ("No space left on device", "NoSpaceLeft", "FileTooBig", "File too large")
"""What the compiler prints about a file that it could not write completely."""


class BuildError(RovError):
    """An error that ends a build. Its text is one line, possibly followed by the compiler's own output."""


class OptionError(BuildError, ValueError):
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
    by_default: bool = True
    """False if an FMU has this platform only on request."""

    def targets(self, fmi: int) -> list[str]:
        """Return the targets of the library for a version of FMI."""
        return [self.target, *([self.also] if self.also and fmi == 2 else [])]


# For a library that uses all usual libraries, the compiler first builds its own of them, which takes 3 s for each
# processor of Linux and macOS, and over a minute for MinGW. The systems have what an FMU needs; but for Windows, the
# compiler has some of it, such as sin(). GLIBC 2.17 is as old as CentOS 7 (2012). Pages of 4 KiB keep the file small.
_LINUX = ("-nostdlib", "-lc", "-lm", "-Wl,-z,max-page-size=4096", "-Wl,-z,common-page-size=4096")
_MACOS = ("-nostdlib", "-lSystem")
_WINDOWS = (
    *("-nostdlib", "-rtlib=compiler-rt"),
    *(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("heap", "math", "stdio", "string")),
)
_APPLE_SILICON = "aarch64-macos.11.0"

# In FMI 2.0, FMPy and FMILibrary load darwin64 on Apple Silicon too. Therefore the file for darwin64 has code for both
# processors. The standard also has a separate folder (2.3). No known importer looks for x86_64-linux, -windows or
# -darwin in FMI 2.0. On Apple Silicon, FMPy, FMILibrary since 3.0.2, CasADi and the Rust crates load aarch64-darwin in
# FMI 3.0.
PLATFORMS: dict[str, Platform] = {
    "linux64": Platform("x86_64-linux", ".so", "x86_64-linux-gnu.2.17", _LINUX),
    "linux32": Platform("x86-linux", ".so", "x86-linux-gnu.2.17", _LINUX, by_default=False),
    "aarch64-linux": Platform("aarch64-linux", ".so", "aarch64-linux-gnu.2.17", _LINUX),
    "win64": Platform("x86_64-windows", ".dll", "x86_64-windows-gnu", (*_WINDOWS, "-Wl,-e,begin_library")),
    "win32": Platform(
        "x86-windows", ".dll", "x86-windows-gnu", (*_WINDOWS, "-Wl,-e,begin_library@12"), by_default=False
    ),
    "darwin64": Platform("x86_64-darwin", ".dylib", "x86_64-macos.11.0", _MACOS, also=_APPLE_SILICON),
    "aarch64-darwin": Platform("aarch64-darwin", ".dylib", _APPLE_SILICON, _MACOS),
}

BACKENDS = ("native", "pythonfmu")
FMI_VERSIONS = (2, 3)
INTERFACES = {
    "cs": ("CoSimulation",),
    "me": ("ModelExchange",),
    "both": ("ModelExchange", "CoSimulation"),
}
"""The kinds of simulation that an FMU offers, by the value of the option `interface`."""

OTHER_NAMES = {
    **{platform.folder: name for name, platform in PLATFORMS.items()},
    **{"linux": "linux64", "arm-linux": "aarch64-linux", "arm64-linux": "aarch64-linux"},
    **dict.fromkeys(("windows", "win"), "win64"),
    **dict.fromkeys(("macos", "mac", "osx", "darwin", "apple"), "darwin64 or aarch64-darwin"),
}
"""Other names of the platforms, such as those of FMI 3.0, and the names used here for them."""


MACHINES = {
    ("Linux", "x86_64"): "linux64",
    ("Linux", "aarch64"): "aarch64-linux",
    ("Windows", "x86_64"): "win64",
    ("Darwin", "x86_64"): "darwin64",
    ("Darwin", "aarch64"): "aarch64-darwin",
}
"""The platforms that this package runs on, by what `platform` calls the system and the processor there."""
HOSTS = tuple(MACHINES.values())


def processor() -> str:
    """Return the name of the processor of this machine, as MACHINES has it."""
    name = platform.machine().lower()
    return {"amd64": "x86_64", "arm64": "aarch64"}.get(name, name)


def host_platform(fmi: int = 2) -> str | None:
    """Return the platform that importers of this version look for on this machine, or None if it is not supported."""
    name = MACHINES.get((platform.system(), processor()))
    return "darwin64" if name == "aarch64-darwin" and fmi == 2 else name


def compiler() -> list[str]:
    """Return the C compiler's command: zig of the ziglang package, or zig, clang or cc on the PATH.

    Raises BuildError when there is none. On Windows, only zig is looked for.
    """
    if package := _package_folder("ziglang"):
        return [str(package / ("zig.exe" if os.name == "nt" else "zig")), "cc"]
    if zig := _on_path("zig"):
        return [zig, "cc"]
    others = [] if os.name == "nt" else ["clang", "cc"]
    if other := next(filter(None, map(_on_path, others)), None):
        return [other]
    raise BuildError(
        f"the C compiler is missing: pip install ziglang, or put {listed(['zig', *others], 'or')} on the PATH"
    )


def _on_path(program: str) -> str | None:
    """Return where a program on the PATH is, from any folder; None if it is not there."""
    place = shutil.which(program)  # relative where the entry of the PATH is
    return str(Path(place).absolute()) if place else None


def is_zig(command: Sequence[str]) -> bool:
    """Return True for the command of zig, which compiles for all platforms."""
    return [*command[1:]] == ["cc"]


def compiler_identity() -> str:
    """Return what tells a compiler from others: its version, or an empty text without a compiler."""
    try:
        command = compiler()
    except BuildError:
        return ""
    if _package_folder("ziglang"):
        return version("ziglang")
    return _version(command)


def _version(command: Sequence[str]) -> str:
    """Return what a compiler says of itself."""
    return subprocess.run([*command, "--version"], capture_output=True, text=True, check=False).stdout


def _zig_library(zig: str) -> Path:
    """Return the folder in which zig has the headers of other systems.

    Below the current folder, zig tells a relative path, and it compiles in another folder.
    """
    said = os.fsdecode(subprocess.run([zig, "env"], capture_output=True, check=False).stdout)
    found = re.search(r'\blib_dir"?\s*[:=]\s*"(.+)"', said)
    return Path(found[1] if found else Path(zig).parent / "lib").absolute()


def _of_other(command: Sequence[str], arguments: Sequence[str], failed: str) -> list[str]:
    """Return arguments of zig as those of clang or gcc, which compile for this machine. Raises BuildError for others.

    The warnings are left out: another version has others, which are not about the vehicle.
    """
    found, rest = list[str](), iter(arguments)
    host, name = host_platform(fmi=3), Path(command[0]).name
    if {LANES_FILE.name, FILTER_LANES_FILE.name} & {*arguments} and "clang" not in _version(command):
        raise BuildError(f"{failed}: {name} lacks the vectors of clang, which is missing: pip install ziglang")
    for argument in rest:
        if argument == "-target":
            if (target := next(rest)) != (host and PLATFORMS[host].target):
                where = f"only for this machine, and not for {target}: pip install ziglang"
                raise BuildError(f"{failed}: {name} compiles {where}")
        elif argument == "-mcpu=native" and platform.machine().lower() in ("x86_64", "amd64"):
            found.append("-march=native")
        elif argument not in ("-mcpu=baseline", *WARNINGS):
            found.append(argument.replace("-fno-slp", "-fno-tree-slp"))  # which clang understands, too
    return [*found, "-w"]


def fmi_headers() -> Path:
    """Return the folder with the FMI headers, which come with FMPy. Raises BuildError when it is not installed."""
    if not (folder := _package_folder("fmpy")):
        raise BuildError("the package fmpy, which has the FMI headers, is not installed")
    return folder / "c-code"


def _package_folder(package: str) -> Path | None:
    """Return the folder of a package without importing it, or None if it is not installed."""
    spec = importlib.util.find_spec(package)
    return Path(spec.origin).parent if spec and spec.origin else None


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
    targets = {name: PLATFORMS[name].targets(fmi) for name in platforms}
    own = {name: [_library(name, target, sources, identifier) for target in some] for name, some in targets.items()}
    return _compiled(own, on_done)


def _library(name: str, target: str, sources: Mapping[str, str], identifier: str) -> "_Library":
    """Return the library of an FMU for one target of the platform with this name."""
    platform = PLATFORMS[name]
    file = f"{identifier}{platform.suffix}"
    arguments = [
        *("-target", target, *C_FLAGS, *_LIBRARY_FLAGS, *WARNINGS),
        *(f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX" for version in (2, 3)),
        *("-isystem", str(fmi_headers())),  # without warnings about the headers
        *(UNITY_FILE, *_platform_flags(platform)),
        *((f"-Wl,-install_name,@rpath/{file}",) if platform.suffix == ".dylib" else ()),
    ]
    return _Library(file, sources, arguments, f"{name}: the compiler failed for {target}")


def _platform_flags(platform: Platform) -> Sequence[str]:
    """Return the arguments for any library of a platform. On Windows, they include a file with its entry point."""
    if platform.suffix != ".dll" or not is_zig(command := compiler()):
        return platform.flags
    headers = _zig_library(command[0]) / "libc" / "include" / "any-windows-any"  # which -nostdlib leaves out
    return ["-isystem", str(headers), str(_WINDOWS_FILE), *platform.flags]


def compile_module(sources: Mapping[str, str]) -> bytes:
    """Compile sources (file name to text) to the WebAssembly module of a page. Raises BuildError."""
    arguments = [*C_FLAGS, "-g0", "-s", *WARNINGS, *_MODULE_FLAGS]
    return _one(_Library("module.wasm", sources, arguments, "the compiler failed for the page's module"))


def compile_location(pythonfmu: bytes) -> bytes:
    """Compile the library of the Python flavour on Linux, which decodes the location of the resources.

    `pythonfmu` is PythonFMU's library, which must lie beside it. Raises BuildError.
    """
    linux = PLATFORMS["linux64"]
    arguments = [
        *("-target", linux.target, "-std=gnu11", "-O2", "-fPIC", *_LIBRARY_FLAGS, *WARNINGS),
        *("-isystem", str(fmi_headers()), _LOCATION_FILE.name),
        *("-Wl,--no-as-needed", PYTHONFMU_LIBRARY, "-Wl,-rpath,$ORIGIN"),
        *("-Wl,--allow-shlib-undefined", "-ldl", *linux.flags),
    ]
    files = {_LOCATION_FILE.name: _LOCATION_FILE.read_bytes(), PYTHONFMU_LIBRARY: pythonfmu}
    reason = "the C compiler failed for the library of the Python flavour"
    return _one(_Library("location.so", files, arguments, reason))


def engine_flags(file: str = ENGINE_FILE.name, platform: str | None = None) -> list[str]:
    """Return the compiler's arguments for a file of the engine: those of the FMU, so the numbers are the same.

    The library is for one of PLATFORMS, by default for this machine.

    The files that compute in the lanes of a vector are compiled for the widest vectors of this processor. The compiler
    warns wrongly about conditions that are vectors (-Wno-conversion). There, a product and a sum are one operation with
    one rounding error, which takes up to a sixth of the time away: the numbers need not be those of the FMU to the last
    bit. The file for many vehicles is compiled together with the engine.
    """
    name = platform or host_platform(fmi=3)
    in_lanes, of_vehicles = file in (LANES_FILE.name, FILTER_LANES_FILE.name), file == LANES_FILE.name
    target = ["-target", PLATFORMS[name].target] if name else []
    vectors = ["-mcpu=native", "-Wno-conversion", "-ffp-contract=on"]
    processor = vectors if in_lanes else [] if name else ["-mcpu=baseline"]
    libraries = _platform_flags(PLATFORMS[name]) if name else ("-lm",)
    files = [file, ENGINE_FILE.name] if of_vehicles else [file]
    return [*target, *C_FLAGS, *_LIBRARY_FLAGS, *WARNINGS, *processor, "-Wno-unused-function", *files, *libraries]


def compile_engine(sources: Mapping[str, str], platform: str | None = None) -> bytes:
    """Compile sources (file name to text), the last of which includes the others, to a library.

    It is for one of PLATFORMS, by default for this machine. Raises BuildError.
    """
    return _one(_engine(sources, platform))


def compile_for(platforms: Sequence[str], sources: Mapping[str, str]) -> dict[str, bytes]:
    """Compile what `compile_engine` compiles for several platforms in parallel. Raises BuildError."""
    return _compiled({name: [_engine(sources, name)] for name in platforms})


def _engine(sources: Mapping[str, str], platform: str | None) -> "_Library":
    *_, file = sources
    reason = "the C compiler failed for the engine"
    return _Library("engine.library", sources, engine_flags(file, platform), reason, most_lines=1)


@dataclass(frozen=True)
class _Library:
    """A library to compile."""

    name: str
    """The name of its file, which some systems write into it."""
    files: Mapping[str, str | bytes]
    """The files that the compiler finds in its folder, by their names."""
    arguments: Sequence[str]
    failed: str
    """The beginning of the message when the compiler fails."""
    most_lines: int = 2 * MOST
    """The largest number of lines of that message."""

    def compile(self, compilers: "_Compilers") -> bytes:
        """Return the content of the library. Raises BuildError."""
        with temporary_folder("fmu-") as folder:
            for file, content in self.files.items():
                Path(folder, file).write_bytes(content.encode() if isinstance(content, str) else content)
            command = compiler()
            own = self.arguments if is_zig(command) else _of_other(command, self.arguments, self.failed)
            command += [*own, "-o", self.name]
            compilers.run(command, folder, self.failed, self.most_lines)
            return Path(folder, self.name).read_bytes()


def _one(library: _Library) -> bytes:
    """Compile one library. Raises BuildError."""
    return _compiled({library.name: [library]})[library.name]


def _universal(libraries: Sequence[_Library], compilers: "_Compilers") -> bytes:
    """Compile a library, or those for the processors of one universal file of macOS. Raises BuildError."""
    contents = [library.compile(compilers) for library in libraries]
    if len(contents) == 1:
        return contents[0]
    universal = FatWriter()  # type: ignore[no-untyped-call]
    for content in contents:
        universal.add(content)
    return bytes(universal.generate())


def _compiled(
    work: Mapping[str, Sequence[_Library]], on_done: Callable[[str], None] = lambda _: None
) -> dict[str, bytes]:
    """Compile libraries in parallel, and return their contents by name. Raises BuildError."""
    try:
        compilers = _Compilers(_cache())
        with ThreadPoolExecutor(os.cpu_count()) as pool, cleaned_up(compilers.end):
            jobs = {pool.submit(_universal, own, compilers): name for name, own in work.items()}
            for job in as_completed(jobs):
                job.result()
                on_done(jobs[job])
            return {name: job.result() for job, name in jobs.items()}
    except OSError as error:
        place = error.filename or f"the temporary folder {tempfile.gettempdir()}"
        raise BuildError(f"cannot compile: {place}: {error.strerror or error}") from error


def _cache() -> str:
    """Return the compiler's cache folder: the usual one, or a temporary one unless this user alone can write that.

    Without a folder that it can write, the compiler may try for ever. What it finds there becomes part of a library.
    """
    folder = Path(os.environ.get(_CACHE_VARIABLE) or user_cache_path("zig", appauthor=False)).absolute()
    try:
        return str(own_folder(folder))
    except OSError as error:
        reason = f"{folder}: the compiler's cache cannot be there: {error.strerror}"
        remedy = f"A temporary one is used, which makes compiling slow; {_CACHE_VARIABLE} can name another folder"
        warnings.warn(f"{reason}. {remedy}", UserWarning, stacklevel=2)
        return _temporary_cache()


@cache
def _temporary_cache() -> str:
    """Make a folder for all compilers of this process, which is removed when the process ends."""
    until_the_end = ExitStack()
    atexit.register(until_the_end.close)
    return until_the_end.enter_context(temporary_folder("rov-fmu-zig-"))


class _Compilers:
    """The compilers that are running. A thread waits for each of them."""

    def __init__(self, cache_folder: str) -> None:
        self._cache = cache_folder
        self._running: set[subprocess.Popen[bytes]] = set()
        self._ended = False

    def end(self) -> None:
        """Kill the compilers, with the processes that they have started, and start no more."""
        with UNINTERRUPTED:
            self._ended = True
            for process in self._running:
                kill(process)

    def run(self, command: Sequence[str], folder: str, failed: str, most_lines: int) -> None:
        """Run a compiler. When this returns, no process writes into the folder any more.

        Raises BuildError if the compiler fails or exceeds its time limit. Its text begins with `failed`, and has a few
        lines of the compiler's output.
        """
        with UNINTERRUPTED:
            if self._ended:
                raise BuildError("interrupted")
            process = subprocess.Popen(
                command,
                cwd=folder,
                env=inherited({_CACHE_VARIABLE: self._cache}),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # so that the compiler's own child processes can be killed with it
            )
            self._running.add(process)
        try:
            output, _ = process.communicate(timeout=_TIME_LIMIT)  # waits for the compiler's child processes too
        except subprocess.TimeoutExpired as error:
            kill(process)
            process.communicate()
            raise BuildError(
                f"{failed}: it did not end within {_TIME_LIMIT:g} s. Its cache is in {self._cache}; {_CACHE_VARIABLE} "
                "can name another folder"
            ) from error
        finally:
            with UNINTERRUPTED:
                self._running.remove(process)
        if process.returncode != 0:
            reasons = self._reasons(process.returncode, output.decode(errors="replace").splitlines())
            raise BuildError(f"{failed}: " + "\n".join(reasons[:most_lines]))

    def _reasons(self, exit_code: int, output: Sequence[str]) -> list[str]:
        """Return why a compiler failed: its own messages, or one line about what this machine does not allow."""
        if any(words in line for line in output for words in _NO_SPACE):
            folders = f"{self._cache} or {tempfile.gettempdir()}"
            return [f"a file in {folders} could not be written completely, because the disk is full{_shell_limits()}"]
        messages = [line for line in output if line.strip() and not line.startswith("warning(")]
        return messages if messages and exit_code > 0 else [f"it ended with {cause(exit_code)}{_shell_limits()}"]


def _shell_limits() -> str:
    """Return the end of a message: the limits under which this process and its compilers run, if there are any."""
    if sys.platform == "win32":
        return ""
    import resource

    kinds = {
        "the size of files (ulimit -f)": resource.RLIMIT_FSIZE,
        "processor time (ulimit -t)": resource.RLIMIT_CPU,
        "memory (ulimit -v)": resource.RLIMIT_AS,
    }
    limited = [words for words, kind in kinds.items() if resource.getrlimit(kind)[0] != resource.RLIM_INFINITY]
    return f"; perhaps because the shell limits {listed(limited)}" if limited else ""
