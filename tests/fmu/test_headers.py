"""The C sources compile under all FMI headers and compilers without warnings, and give the same bits.

The headers in FMPy's package never add a prefix to names. The other headers are made from them by the differences of
the standard's releases: FMI 2.0.0 (as in FMI Library, FMI4cpp, MasterSim or PythonFMU 0.6.3) has const members in
fmi2CallbackFunctions and pastes the prefix; 2.0.1 to 2.0.3 (and Reference-FMUs) paste it; 2.0.4 and 2.0.5 do, unless
FMI2_OVERRIDE_FUNCTION_PREFIX is defined. FMPy's headers of FMI 3.0 are those of the standard, and
handle prefixes like 2.0.4.
"""

import platform
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import lief
import pytest

from rov_fmu.c.compile import compiler, fmi_headers
from tests import fmi2, fmi3
from tests.fmi import Fmu
from tests.fmu.calls.test_versions import run

_EXPORT = "#if defined _WIN32"  # begins the definition of FMI2_Export in FMPy's header
_NAME = "#define fmi2FullName(name) name"
_KNOWS_OVERRIDE = (
    "#if !defined FMI2_OVERRIDE_FUNCTION_PREFIX && defined FMI2_FUNCTION_PREFIX\n"
    "#define FMI2_ACTUAL_FUNCTION_PREFIX FMI2_FUNCTION_PREFIX\n#endif\n"
)


def _write_headers(folder: Path, release: str) -> Path:
    shutil.copytree(fmi_headers(), folder)
    if release == "3.0":
        return folder
    functions, types = folder / "fmi2Functions.h", folder / "fmi2FunctionTypes.h"
    prefix = "FMI2_ACTUAL_FUNCTION_PREFIX" if release == "2.0.4" else "FMI2_FUNCTION_PREFIX"
    if release != "FMPy":
        text = functions.read_text(encoding="utf-8")
        assert text.count(_EXPORT) == text.count(_NAME) == 1
        before, _, after = text.partition(_EXPORT)
        export, _, after = after.partition(_NAME)
        functions.write_text(
            f"{before}{_KNOWS_OVERRIDE if release == '2.0.4' else ''}#if defined FMI2_Export\n#elif defined {prefix}\n"
            f"#define FMI2_Export\n#elif defined _WIN32{export}\n#ifdef {prefix}\n#define fmi2Paste(a, b) a##b\n"
            f"#define fmi2PasteB(a, b) fmi2Paste(a, b)\n#define fmi2FullName(name) fmi2PasteB({prefix}, name)\n#else\n"
            f"{_NAME}\n#endif\n{after}",
            encoding="utf-8",
        )
    if release == "2.0.0":
        text, n = re.subn(
            r"^( +)(fmi2\w+ +(?:logger|allocateMemory|freeMemory|stepFinished|componentEnvironment);)",
            r"\1const \2",
            types.read_text(encoding="utf-8"),
            flags=re.M,
        )
        assert n == 5
        types.write_text(text, encoding="utf-8")
    return folder


_OF_FMI2 = ("2.0.0", "2.0.1", "2.0.4", "FMPy")
RELEASES = (*_OF_FMI2, "3.0")


def _version(release: str) -> int:
    return 3 if release == "3.0" else 2


@pytest.fixture(scope="module")
def fmus(fmu: fmi2.Fmu, videoray3_dir: Path) -> dict[int, Fmu]:
    """Return the FMUs by their version of FMI."""
    return {2: fmu, 3: fmi3.Fmu(videoray3_dir)}


@pytest.fixture(scope="module")
def headers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("headers")
    return {release: _write_headers(folder / release, release) for release in RELEASES}


_STRICT = ("-pedantic", "-Wall", "-Wextra", "-Werror")
_PLAIN = {"2.0.4": ("-DFMI2_OVERRIDE_FUNCTION_PREFIX",), "3.0": ("-DFMI3_OVERRIDE_FUNCTION_PREFIX",)}
"""The flags that headers need for a shared library; other headers need none."""
COMPILERS = {"zig": compiler()} | {name: [name] for name in ("gcc", "clang") if shutil.which(name)}
_HAS_FMA = "fma" in Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else False


def _compile(fmu: Fmu, headers: Path, command: Sequence[str], library: Path, warnings: Sequence[str] = _STRICT) -> Path:
    """Compile the FMU's sources to a shared library, without warnings."""
    sources = fmu.folder / "sources"
    include = (
        "-isystem" if headers.name == "3.0" else "-I"
    )  # because the headers of the standard declare f() without arguments
    shared = ("-shared", "-fPIC", include, str(headers), "fmu.c", "-lm", "-o", str(library))
    built = subprocess.run([*command, *warnings, *shared], cwd=sources, capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    return library


def _values(fmu: Fmu) -> list[bytes]:
    """Return all values along a random motion: turns, reversals, saturation, loads, tuning, long and short steps."""
    with fmu.instance() as rov:
        rov.start({"u": -0.4, "r": 0.9, "psi": 2.0, "gamma": 0.4})
        return run(rov, 400)


@pytest.fixture(scope="module")
def shipped(fmu: fmi2.Fmu) -> list[bytes]:
    """Return the values of the FMU that was built, which both versions of FMI share."""
    return _values(fmu)


def _exports(library: Path) -> set[str]:
    binary = lief.parse(str(library))
    assert isinstance(binary, lief.ELF.Binary | lief.PE.Binary | lief.MachO.Binary)
    return {name for function in binary.exported_functions if re.search("fmi[23]", name := str(function.name))}


_STANDARDS, _NAMES = ("c99", "c11"), list(COMPILERS)
_CPP = ("-x", "c++", "-std=c++17", "-O2")
_needs_fma = pytest.mark.skipif(
    platform.machine() != "x86_64" or not _HAS_FMA, reason="needs an x86-64 processor with FMA"
)


def _builds() -> Iterator[Any]:
    """Yield header, compiler and flags of each library: every header, compiler and standard, C++, fused products."""
    for i, release in enumerate(RELEASES):
        marks = pytest.mark.long if release in _PLAIN else pytest.mark.weekly
        yield pytest.param(release, _NAMES[i % len(_NAMES)], (f"-std={_STANDARDS[i % 2]}", "-O2"), marks=marks)
    yield "3.0", "zig", _CPP
    yield pytest.param("2.0.0", _NAMES[-1], ("-O2", "-march=haswell"), marks=_needs_fma)


@pytest.mark.long
@pytest.mark.parametrize(("release", "name", "flags"), list(_builds()))
def test_a_shared_library_has_plain_names_and_gives_the_same_values(
    fmus: dict[int, Fmu],
    headers: dict[str, Path],
    shipped: list[bytes],
    tmp_path: Path,
    release: str,
    name: str,
    flags: Sequence[str],
) -> None:
    """Compound literals are an extension of GCC and Clang in C++, so the flag -pedantic is left out there."""
    fmu = fmus[_version(release)]
    warnings = _STRICT if flags != _CPP else _STRICT[1:]
    command = [*COMPILERS[name], *flags, *_PLAIN.get(release, ())]
    library = _compile(fmu, headers[release], command, tmp_path / "videoray.so", warnings)
    assert _exports(library) == _exports(fmu.library)
    assert _values(type(fmu)(fmu.folder, library)) == shipped


@pytest.mark.long
@pytest.mark.parametrize("release", ["2.0.4", "3.0"])
def test_in_a_static_library_every_name_has_the_prefix_of_the_model(
    fmus: dict[int, Fmu], headers: dict[str, Path], tmp_path: Path, release: str
) -> None:
    """So one program can contain several models, in both versions of FMI."""
    fmu, compiled = fmus[_version(release)], str(tmp_path / "fmu.o")
    command = [*compiler(), "-target", "x86_64-linux-gnu", "-std=c11", "-isystem", str(headers[release])]
    subprocess.run([*command, "-c", "fmu.c", "-o", compiled], cwd=fmu.folder / "sources", check=True)
    library = lief.ELF.parse(compiled)
    assert library is not None
    defined = {str(s.name) for s in library.symbols if s.binding == lief.ELF.Symbol.BINDING.GLOBAL and s.shndx}
    assert defined == {f"videoray_{name}" for name in _exports(fmu.library)}


_OF_ONE = ("fabs", "ceil", "sqrt", "sin", "cos", "exp", "log", "log1p", "expm1", "atan", "atanh")
_OF_TWO = ("fmin", "fmax", "copysign", "hypot", "pow", "remainder")
# The parts of the C library that the sources use, as Microsoft's headers declare them; no package has those headers.
_MICROSOFT = {
    "math.h": "#define INFINITY ((float)(1e300 * 1e300))\n#define NAN (-(float)(INFINITY * 0.0f))\n"
    "short _dclass(double);\n#define isfinite(x) (_dclass(x) <= 0)\n#define isnan(x) (_dclass(x) == 2)\n"
    + "".join(f"double {f}(double);\n" for f in _OF_ONE)
    + "".join(f"double {f}(double, double);\n" for f in _OF_TWO),
    "stdlib.h": "#include <stddef.h>\nvoid *calloc(size_t, size_t);\nvoid free(void *);\n",
    "string.h": "#include <stddef.h>\nvoid *memset(void *, int, size_t);\nvoid *memcpy(void *, const void *, size_t);\n"
    "int memcmp(const void *, const void *, size_t);\nint strcmp(const char *, const char *);\n"
    "size_t strlen(const char *);\nchar *strcpy(char *, const char *);\nsize_t strspn(const char *, const char *);\n",
    "stdio.h": "#include <stdarg.h>\n#include <stddef.h>\nint vsnprintf(char *, size_t, const char *, va_list);\n"
    "int snprintf(char *, size_t, const char *, ...);\n",
}


@pytest.mark.parametrize("release", RELEASES)
def test_the_sources_compile_like_with_microsofts_compiler(
    fmus: dict[int, Fmu], headers: dict[str, Path], tmp_path: Path, release: str
) -> None:
    """Clang takes the place of Microsoft's compiler, with its target and language and without __GNUC__."""
    for name, text in _MICROSOFT.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    zig = Path(compiler()[0])
    result = subprocess.run(
        [
            *(zig, "clang", "--target=x86_64-pc-windows-msvc", "-fms-compatibility", "-fms-extensions"),
            *("-fms-compatibility-version=19.30", "-ffreestanding", "-nostdinc", "-fsyntax-only", "-std=c11"),
            *(*_STRICT, "-isystem", tmp_path, "-isystem", zig.parent / "lib" / "include"),
            *("-isystem", headers[release], "fmu.c"),
        ],
        cwd=fmus[_version(release)].folder / "sources",
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stderr) == (0, "")
