"""The C sources that travel in the FMU: compiled by an importer, linked into a program, free of warnings."""

import os
import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest
from fmpy.build import build_platform_binary

from rov_fmu.export.archive import Content, native_content
from rov_fmu.export.compile import WARNINGS, compiler, fmi_headers
from rov_fmu.vehicle.vehicle import Vehicle


def _write_sources(content: Content, folder: Path) -> Path:
    folder.mkdir()
    for name, text in content.sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def zig_as_cc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiler and the build tool from packages, for CMake on a machine that has none."""
    if os.name == "nt":
        pytest.skip("FMPy asks for Visual Studio on Windows")
    cc = tmp_path / "cc"
    cc.write_text(f'#!/bin/sh\nexec {shlex.join(compiler())} "$@"\n', encoding="utf-8")
    cc.chmod(0o755)
    monkeypatch.setenv("CC", str(cc))
    monkeypatch.setenv("CXX", str(cc))  # CMake asks for one; nothing is compiled with it
    monkeypatch.setenv("CMAKE_GENERATOR", "Ninja")


@pytest.mark.usefixtures("zig_as_cc")
def test_fmpy_compiles_and_runs_them(videoray_dir: Path, tmp_path: Path) -> None:
    folder = tmp_path / "source fmu"
    shutil.copytree(videoray_dir, folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    built = fmpy.simulate_fmu(str(folder), start_values={"u_l": 0.3, "u_r": 0.1})
    shipped = fmpy.simulate_fmu(str(videoray_dir), start_values={"u_l": 0.3, "u_r": 0.1})
    for name in built.dtype.names:
        assert built[name] == pytest.approx(shipped[name], rel=1e-12, abs=1e-12)


def test_two_models_link_into_one_program_under_their_prefixes(vehicle: Vehicle, tmp_path: Path) -> None:
    # FMPy's fmi2Functions.h leaves out the prefix; the standard's own pastes it in front, as is done here.
    headers = tmp_path / "headers"
    shutil.copytree(fmi_headers(), headers)
    functions = headers / "fmi2Functions.h"
    plain = "#define fmi2FullName(name) name"
    pasted = (
        "#define fmi2Paste(a, b) a##b\n#define fmi2PasteB(a, b) fmi2Paste(a, b)\n"
        "#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)"
    )
    text = functions.read_text(encoding="utf-8")
    assert plain in text
    functions.write_text(text.replace(plain, pasted), encoding="utf-8")

    calls = []
    for identifier in ("videoray", "sister"):
        content = native_content(replace(vehicle, identifier=identifier))
        _write_sources(content, tmp_path / identifier)
        subprocess.run(
            [*compiler(), "-std=c11", "-c", "-I", str(headers), "fmu.c", "-o", "../" + identifier + ".o"],
            cwd=tmp_path / identifier,
            check=True,
        )
        calls.append(f'    printf("%p\\n", instantiate({identifier}_fmi2Instantiate, "{content.guid}"));')
    main = tmp_path / "main.c"
    main.write_text(
        '#include "fmi2FunctionTypes.h"\n#include <stdio.h>\n'
        "fmi2InstantiateTYPE videoray_fmi2Instantiate, sister_fmi2Instantiate;\n"
        "static void *instantiate(fmi2InstantiateTYPE *f, const char *guid)\n{\n"
        "    static const fmi2CallbackFunctions callbacks;\n"
        '    return f("rov", fmi2CoSimulation, guid, NULL, &callbacks, fmi2False, fmi2False);\n}\n'
        "int main(void)\n{\n" + "\n".join(calls) + "\n    return 0;\n}\n",
        encoding="utf-8",
    )
    subprocess.run(
        [*compiler(), "-I", str(headers), "main.c", "videoray.o", "sister.o", "-lm", "-o", "main"],
        cwd=tmp_path,
        check=True,
    )
    pointers = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.split()
    assert len(pointers) == len(set(pointers)) == 2
    assert "(nil)" not in pointers


@pytest.mark.parametrize("optimization", ["-O0", "-O3"])
def test_no_warning_under_the_strictest_flags(vehicle: Vehicle, tmp_path: Path, optimization: str) -> None:
    folder = _write_sources(native_content(vehicle), tmp_path / "c")
    more = ["-Wshadow", "-Wundef", "-Wstrict-prototypes", "-Wcast-qual", "-Wvla"]
    flags = ["-std=c11", *WARNINGS, *more, optimization, "-c", "-isystem", str(fmi_headers())]
    result = subprocess.run([*compiler(), *flags, "fmu.c"], cwd=folder, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
