"""The platforms that binaries are compiled for (rov_fmu/c/compile.py)."""

import ctypes
import os
import platform
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from rov_fmu.build import _only_here
from rov_fmu.c import compile as module
from rov_fmu.c.compile import PLATFORMS, engine_flags, host_platform


@pytest.mark.parametrize(
    ("system", "machine", "in_fmi_2", "in_fmi_3"),
    [
        ("Linux", "x86_64", "linux64", "linux64"),
        ("Linux", "aarch64", "aarch64-linux", "aarch64-linux"),
        ("Windows", "AMD64", "win64", "win64"),
        ("Darwin", "x86_64", "darwin64", "darwin64"),
        ("Darwin", "arm64", "darwin64", "aarch64-darwin"),
        ("Linux", "riscv64", None, None),
        ("Windows", "ARM64", None, None),
    ],
)
def test_the_platform_of_a_machine_is_the_one_that_importers_look_for(
    system: str, machine: str, in_fmi_2: str | None, in_fmi_3: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, "system", lambda: system)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    assert (host_platform(), host_platform(fmi=2), host_platform(fmi=3)) == (in_fmi_2, in_fmi_2, in_fmi_3)
    flags = engine_flags()
    if in_fmi_3 is None:
        assert ("-mcpu=baseline" in flags, "-target" in flags, flags[-1]) == (True, False, "-lm")
    else:
        assert flags[:2] == ["-target", PLATFORMS[in_fmi_3].targets(3)[0]]
        assert ("-lm" in flags) == (system == "Linux")
    special = [(flags, "engine.c"), *((engine_flags(file), file) for file in ("lanes.c", "filter_lanes.c"))]
    found = [("-mcpu=native" in of, "-ffp-contract=on" in of, "engine.c" in of, file in of) for of, file in special]
    assert found == [(False, False, True, True), (True, True, True, True), (True, True, False, True)]


def test_only_in_fmi_2_the_library_for_the_mac_is_for_both_of_its_processors() -> None:
    macs = ["x86_64-macos.11.0", "aarch64-macos.11.0"]
    assert [PLATFORMS["darwin64"].targets(fmi) for fmi in (2, 3)] == [macs, macs[:1]]
    assert {len(one.targets(2)) for name, one in PLATFORMS.items() if name != "darwin64"} == {1}


@pytest.fixture
def compiled_by(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A script that replaces the compiler, with a cache folder that nobody can make."""
    script = tmp_path / "cc"
    monkeypatch.setattr(module, "compiler", lambda: [str(script), "cc"])
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", "/proc/x/zig")
    yield script
    module._temporary_cache.cache_clear()


def _write(script: Path, text: str) -> None:
    script.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is a folder in which not even root can create files")
@pytest.mark.filterwarnings("ignore:/proc/x/zig")
@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("sleep 60", "it did not end within 0.3 s. Its cache is in .*; ZIG_GLOBAL_CACHE_DIR can name another folder$"),
        ("kill -XFSZ $$", "it ended with SIGXFSZ; perhaps because the shell limits the size of files .ulimit -f.$"),
        ("exit 3", "it ended with exit code 3; perhaps because the shell limits the size of files .ulimit -f.$"),
        ("echo warning; echo IO: No space left on device; exit 1", "could not be written completely, because the disk"),
        ("echo a.c:1: error; kill -9 $$", "it ended with SIGKILL; perhaps because the shell limits the size of files "),
    ],
)
def test_why_a_compiler_failed(compiled_by: Path, script: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import resource

    _write(compiled_by, script)
    monkeypatch.setattr(module, "_TIME_LIMIT", 0.3, raising=False)
    limits = {resource.RLIMIT_FSIZE: (1000, 1000)}
    none = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    monkeypatch.setattr(resource, "getrlimit", lambda kind: limits.get(kind, none))
    with pytest.raises(module.BuildError, match="^the compiler failed for the page's module: .*" + said) as error:
        module.compile_module({})
    assert len(str(error.value).splitlines()) == 1


def test_the_messages_of_a_compiler_are_told_but_not_all(compiled_by: Path) -> None:
    """The engine is compiled while a simulation begins, which has room for one line."""
    _write(compiled_by, 'echo "warning(cache): slow"; echo; for n in $(seq 30); do echo "a.c:$n: error"; done; exit 1')
    for compile_c, what, lines in (
        (module.compile_module, "the compiler failed for the page's module", 20),
        (module.compile_engine, "the C compiler failed for the engine", 1),
    ):
        with pytest.warns(UserWarning, match="^/proc/x/zig: .* A temporary"), pytest.raises(module.BuildError) as error:
            compile_c({"engine.c": ""})
        assert str(error.value) == f"{what}: " + "\n".join(f"a.c:{n}: error" for n in range(1, lines + 1))


# ---- Another compiler ------------------------------------------------------------------------------------------------


@pytest.fixture
def without_ziglang(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is all of the PATH, on a machine without the package."""
    _forget_ziglang(monkeypatch)
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


def _forget_ziglang(monkeypatch: pytest.MonkeyPatch) -> None:
    folder_of = module._package_folder
    monkeypatch.setattr(module, "_package_folder", lambda name: None if name == "ziglang" else folder_of(name))


@pytest.mark.skipif(sys.platform == "win32", reason="there, only zig is looked for")
def test_a_compiler_on_the_path_serves_without_ziglang(without_ziglang: Path) -> None:
    with pytest.raises(module.BuildError, match="missing: pip install ziglang, or put zig, clang or cc on the PATH"):
        module.compiler()
    assert module.compiler_identity() == ""
    for name, words in (("cc", [""]), ("clang", [""]), ("zig", ["", " cc"])):
        _write(without_ziglang / name, f"echo {name}")
        command = module.compiler()
        assert command == [str(without_ziglang / name), *(["cc"] if len(words) > 1 else [])], "the best one there is"
        assert module.is_zig(command) == (name == "zig")
        assert module.compiler_identity() == f"{name}\n", "another compiler has another place in the cache"


_THREE = '__attribute__((visibility("default"))) int three(void);\nint three(void) { return 3; }\n'


@pytest.mark.parametrize("is_package", [True, False])
def test_paths_relative_to_the_current_folder_hold_in_that_of_the_compiler(
    is_package: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """zig lies below the current folder, as in `.venv`, and then tells its own folder relative to it.

    So are entries of the PATH, and the temporary folder. Another folder of zig is taken from there, too.
    """
    zig = Path(os.path.realpath(module.compiler()[0]))
    monkeypatch.chdir(zig.parents[1])
    for name in ("TMPDIR", "TEMP", "TMP"):
        monkeypatch.setenv(name, os.path.relpath(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    if not is_package:
        _forget_ziglang(monkeypatch)
        monkeypatch.setenv("PATH", zig.parent.name)
        monkeypatch.setenv("ZIG_LIB_DIR", f"{zig.parent.name}/lib")
    (library,) = module.compile_all(["win64"], {"fmu.c": f"#include <math.h>\n{_THREE}"}, "rov").values()
    assert library.startswith(b"MZ")
    assert [*tmp_path.iterdir()] == []


OTHERS = [name for name in ("clang", "gcc") if shutil.which(name)]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, these were not tried")
@pytest.mark.parametrize("name", OTHERS)
def test_another_compiler_compiles_for_this_machine_alone(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its library loads. What it cannot compile is one line that names it and the remedy."""
    command = [str(shutil.which(name))]
    monkeypatch.setattr(module, "compiler", lambda: command)
    host = host_platform(fmi=3)
    assert host
    library = tmp_path / "library.so"
    library.write_bytes(module.compile_engine({"engine.c": _THREE}, host))
    assert ctypes.CDLL(str(library)).three() == 3
    for platform_name in (other for other in PLATFORMS if other not in (host, "darwin64")):
        with pytest.raises(module.BuildError) as error:
            module.compile_all([platform_name], {"fmu.c": ""}, "rov")
        target = PLATFORMS[platform_name].target
        reason = f"{name} compiles only for this machine, and not for {target}: pip install ziglang"
        assert str(error.value) == f"{platform_name}: the compiler failed for {target}: {reason}"
    with pytest.raises(module.BuildError, match=f"{name} compiles only for this machine, and not for wasm32"):
        module.compile_module({"module.c": ""})
    if name == "gcc":
        with pytest.raises(module.BuildError, match="gcc lacks the vectors of clang"):
            module.compile_engine({"lanes.c": ""})


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, these were not tried")
def test_a_build_has_only_the_binary_that_the_compiler_can_make(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rov_fmu.build.compiler", lambda: ["/usr/bin/cc"])
    with pytest.warns(UserWarning, match="^cc compiles only for this machine, .*: pip install ziglang for others$"):
        assert _only_here(2) == host_platform(fmi=2)
    monkeypatch.setattr("rov_fmu.build.compiler", lambda: ["/usr/bin/zig", "cc"])
    assert _only_here(2) is None
