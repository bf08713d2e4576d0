"""The platforms that binaries are compiled for (rov_fmu/c/compile.py)."""

import platform
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rov_fmu.c import compile as module
from rov_fmu.c.compile import PLATFORMS, engine_flags, host_platform

LINUX = ("-lm", "-Wl,-z,max-page-size=4096", "-Wl,-z,common-page-size=4096")
EXPECTED = {
    "linux64": ("x86_64-linux", ".so", ["x86_64-linux-gnu.2.17"], LINUX),
    "linux32": ("x86-linux", ".so", ["x86-linux-gnu.2.17"], LINUX),
    "aarch64-linux": ("aarch64-linux", ".so", ["aarch64-linux-gnu.2.17"], LINUX),
    "win64": ("x86_64-windows", ".dll", ["x86_64-windows-gnu"], ()),
    "win32": ("x86-windows", ".dll", ["x86-windows-gnu"], ()),
    "darwin64": ("x86_64-darwin", ".dylib", ["x86_64-macos.11.0"], ()),
    "aarch64-darwin": ("aarch64-darwin", ".dylib", ["aarch64-macos.11.0"], ()),
}


@pytest.mark.parametrize("fmi", [2, 3])
def test_every_platform_has_its_folder_suffix_targets_and_flags(fmi: int) -> None:
    """In FMI 2.0, the library of macOS is of both processors."""
    for name, (*own, targets, flags) in EXPECTED.items():
        both = ["aarch64-macos.11.0"] if (name, fmi) == ("darwin64", 2) else []
        p = PLATFORMS[name]
        assert ([p.folder, p.suffix], p.targets(fmi), p.flags) == (own, [*targets, *both], flags)
    assert [*PLATFORMS] == [*EXPECTED]


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
        assert flags[:2] == ["-target", *EXPECTED[in_fmi_3][2]]
        assert tuple(flags[flags.index("engine.c") + 1 :]) == EXPECTED[in_fmi_3][3]


@pytest.fixture
def compiled_by(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A script that replaces the compiler, with a cache folder that nobody can make."""
    script = tmp_path / "cc"
    monkeypatch.setattr(module, "compiler", lambda: [str(script)])
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
