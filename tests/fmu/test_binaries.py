"""Each binary of an archive for all platforms: its dependencies, its exports and its results.

A build for seven platforms takes half a minute of processor time, and the programs that run the binaries of Windows
need the libraries of MinGW, which are compiled first: these tests are long.
"""

import os
import random
import re
import shutil
import struct
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import lief
import numpy as np
import pytest

from rov_fmu.c.compile import PLATFORMS, fmi_headers
from rov_fmu.cli import main
from tests.conftest import Made
from tests.often import spread
from tests.vehicles import VIDEORAY, random_inputs
from verification.references.c_programs import compile_c, run_program

lief.logging.disable()

LINUX = ["linux64", "linux32", "aarch64-linux"]
WINDOWS = ["win64", "win32"]
DARWIN = ["darwin64", "aarch64-darwin"]
TUPLES = {
    "linux64": "x86_64-linux",
    "linux32": "x86-linux",
    "aarch64-linux": "aarch64-linux",
    "win64": "x86_64-windows",
    "win32": "x86-windows",
    "darwin64": "x86_64-darwin",
    "aarch64-darwin": "aarch64-darwin",
}
"""The folders in FMI 3.0 by those in FMI 2.0."""
_NEEDED = {
    "heap": ("calloc", "free"),
    "stdio": ("__stdio_common_vsprintf",),
    "string": ("strcmp", "strcpy", "strlen", "strspn"),
}
"""What the binaries need of the C run time of Windows."""
LARGEST = 600_000  # bytes, including 31,000 for the page that flies the vehicle


def functions(fmi: int) -> set[str]:
    """Return the names of all functions of a version, from its header."""
    header = (fmi_headers() / f"fmi{fmi}Functions.h").read_text(encoding="utf-8")
    found = set(re.findall(rf"#define (fmi{fmi}\w+)\s+fmi{fmi}FullName\(\1\)", header))
    assert len(found) == {2: 44, 3: 75}[fmi]
    return found


@dataclass(frozen=True)
class Binaries:
    """An unzipped FMU for all platforms, of a version of FMI."""

    archive: Path
    folder: Path
    fmi: int

    def of(self, name: str) -> Path:
        folder = TUPLES[name] if self.fmi == 3 else name
        return self.folder / "binaries" / folder / f"videoray{PLATFORMS[name].suffix}"


@pytest.fixture(
    scope="session",
    params=[pytest.param(2, marks=pytest.mark.long), pytest.param(3, marks=pytest.mark.weekly)],
    ids=["FMI 2.0", "FMI 3.0"],
)
def binaries(request: pytest.FixtureRequest, made_once: Made) -> Binaries:
    """The FMU for all platforms, not only those by default."""

    def found(folder: Path) -> Binaries:
        return Binaries(folder / "videoray.fmu", folder / "fmu", request.param)

    def fill(folder: Path) -> None:
        platforms = [f"--platform={name}" for name in PLATFORMS]
        assert main(["build", "--fmi", str(request.param), *platforms, "-o", str(found(folder).archive)]) == 0
        fmpy.extract(str(found(folder).archive), unzipdir=str(found(folder).folder))

    return found(made_once(f"all platforms of FMI {request.param}", fill))


def test_one_archive_holds_all_platforms(binaries: Binaries) -> None:
    assert binaries.archive.stat().st_size <= LARGEST
    with zipfile.ZipFile(binaries.archive) as content:
        names = {n for n in content.namelist() if n.startswith("binaries/")}
    assert names == {binaries.of(name).relative_to(binaries.folder).as_posix() for name in PLATFORMS}
    assert set(PLATFORMS) == {*LINUX, *WINDOWS, *DARWIN}


@pytest.mark.skipif(sys.platform != "linux", reason="other platforms are tested in the archive for all platforms")
def test_the_library_of_this_machine_has_all_functions(either_dir: Path, fmi: int) -> None:
    (path,) = (either_dir / "binaries").glob("*/*.so")
    library = lief.ELF.parse(path)
    assert library is not None
    assert {s.name for s in library.exported_symbols} == functions(fmi)


@pytest.mark.parametrize("name", LINUX)
def test_linux_needs_only_libc_and_libm_of_2012(binaries: Binaries, name: str) -> None:
    library = lief.ELF.parse(binaries.of(name))
    assert library is not None
    assert set(library.libraries) <= {"libc.so.6", "libm.so.6"}
    versions = re.findall(r"GLIBC_([\d.]+)", " ".join(str(s.symbol_version) for s in library.imported_symbols))
    assert versions
    assert max(tuple(map(int, v.split("."))) for v in versions) <= (2, 17)
    assert {s.name for s in library.exported_symbols} == functions(binaries.fmi)


@pytest.mark.parametrize("name", WINDOWS)
def test_windows_needs_only_a_few_functions_of_its_c_run_time(binaries: Binaries, name: str) -> None:
    """Thread-local storage or constructors would need the entry point of MinGW, which the library does not have."""
    library = lief.PE.parse(binaries.of(name))
    assert library is not None
    needed = {(str(i.name), str(entry.name)) for i in library.imports for entry in i.entries}
    known = {(f"api-ms-win-crt-{part}-l1-1-0.dll", name) for part, names in _NEEDED.items() for name in names}
    assert needed <= known
    assert not library.has_tls
    assert not [section.name for section in library.sections if str(section.name).startswith((".ctors", ".CRT"))]
    exports = library.get_export()
    assert exports is not None
    assert {e.name for e in exports.entries} == functions(binaries.fmi)


@pytest.mark.parametrize("name", DARWIN)
def test_darwin_has_the_processors_of_its_folder_and_needs_only_the_system(binaries: Binaries, name: str) -> None:
    universal = lief.MachO.parse(binaries.of(name))
    assert universal is not None
    slices = {str(part.header.cpu_type).rsplit(".", 1)[-1]: part for part in universal}
    # FMPy loads darwin64 on both, and in FMI 3.0 the folder of the processor
    both = {"X86_64", "ARM64"} if binaries.fmi == 2 else {"X86_64"}
    assert set(slices) == (both if name == "darwin64" else {"ARM64"})
    for part in slices.values():
        assert {str(lib.name) for lib in part.libraries} == {"@rpath/videoray.dylib", "/usr/lib/libSystem.B.dylib"}
        assert part.dyld_info is not None
        exported = {str(e.symbol.name) for e in part.dyld_info.exports if e.symbol is not None}
        # the linker adds two symbols
        assert exported - {"__mh_dylib_header", "___dso_handle"} == {f"_{f}" for f in functions(binaries.fmi)}
    if "ARM64" in slices:
        assert slices[
            "ARM64"
        ].has_code_signature  # Apple Silicon loads only signed libraries; an ad-hoc signature is enough


# ---- Run for real --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Machine:
    """The command that runs a program for a platform here, and the files that it needs."""

    target: str
    suffix: str = ""
    command: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()

    def missing(self) -> list[str]:
        """Return the patterns of files, and the programs, of which there is none."""
        found = {name: shutil.which(name) or [*Path("/").glob(name[1:])] for name in (*self.command[:1], *self.needs)}
        return [name for name, paths in found.items() if not paths]


_AARCH64_ROOT = "/usr/aarch64-linux-gnu"
MACHINES = {
    "linux64": Machine("x86_64-linux-gnu.2.17"),
    "linux32": Machine("x86-linux-gnu.2.17", needs=("/lib/ld-linux.so.2",)),
    "aarch64-linux": Machine(
        "aarch64-linux-gnu.2.17", "", ("qemu-aarch64", "-L", _AARCH64_ROOT), (f"{_AARCH64_ROOT}/lib",)
    ),
    "win64": Machine("x86_64-windows-gnu", ".exe", ("wine",)),
    "win32": Machine("x86-windows-gnu", ".exe", ("wine",), ("/usr/lib/i386-linux-gnu/wine*",)),
}


def _recorded_steps() -> str:
    """Return commands that reach every branch of the step: reversals, turns, rest, loads, current, 1e-5 s to 1e3 s."""
    rng, lines = random.Random(20), []
    for _ in range(400):
        h = 10.0 ** rng.uniform(-5.0, 1.0) if rng.random() < 0.98 else 1000.0
        lines.append(" ".join(struct.pack(">d", x).hex() for x in (h, *random_inputs(rng, VIDEORAY).values())))
    return "\n".join(lines) + "\n"


def _run(binaries: Binaries, name: str, folder: Path) -> np.ndarray:
    machine = MACHINES[name]
    if missing := machine.missing():
        pytest.skip(f"{name}: there is no {', '.join(missing)}")
    program = folder / f"host-{name}-{binaries.fmi}{machine.suffix}"
    # The flags are those of the binaries, so that the compiler finds the C library that it built for them.
    of_binaries = ("-g0", "-s", "-fvisibility=hidden", "-fno-asynchronous-unwind-tables")
    flags = ("-target", machine.target, *of_binaries, *(() if machine.suffix else ("-ldl",)))
    compile_c(Path(__file__).with_name("host.c"), program, binaries.folder / "sources", *flags)
    library = shutil.copy(binaries.of(name), folder / f"{name}-{binaries.fmi}{PLATFORMS[name].suffix}")
    environment = os.environ | {"WINEPREFIX": str(folder / "wine"), "WINEDEBUG": "-all"}
    command: list[str | Path] = [*machine.command, program, f"./{Path(library).name}"]
    run = run_program(*command, input=_recorded_steps(), cwd=folder, env=environment)
    assert run.code == 0, run.errors
    return np.array([[struct.unpack(">d", bytes.fromhex(x))[0] for x in line] for line in run.lines])


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("hosts")


@pytest.fixture(scope="session")
def trajectory(binaries: Binaries, folder: Path) -> np.ndarray:
    if sys.platform != "linux":
        pytest.skip("the programs are run on Linux")
    return _run(binaries, "linux64", folder)


@pytest.mark.parametrize("name", [*LINUX[1:], *spread(WINDOWS, (), ["win64"])])
def test_every_platform_runs_as_linux64_does(
    binaries: Binaries, folder: Path, trajectory: np.ndarray, name: str
) -> None:
    other = _run(binaries, name, folder)
    assert trajectory.shape == (400, 14)  # 7 states, 4 forces and torques, 3 velocities over ground
    assert np.isfinite(trajectory).all()
    scale = np.maximum.accumulate(np.abs(trajectory))
    assert np.all(np.abs(other - trajectory) <= 1e-12 * scale + 1e-300)
