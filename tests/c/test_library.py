"""The engine's library is compiled once for each layout, kept in the cache folder, and never loaded when damaged."""

import ctypes
import importlib.util
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from rov_fmu.c import library
from rov_fmu.c.compile import BuildError, compile_engine
from rov_fmu.c.library import load_library
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE
from tests.vehicles import VEHICLES

ROV = load_vehicle(BARE)
_MADE: dict[str, bytes] = {}
"""The libraries that these tests have compiled, by their sources."""


class Cache:
    """A separate cache folder, and the number of compilations for it."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder / "engine"
        self.compiled = 0
        self._monkeypatch = monkeypatch
        monkeypatch.setattr(library, "user_cache_path", lambda *_, **__: folder)
        monkeypatch.setattr(library, "compile_engine", self._compile)
        self.restart()

    def restart(self) -> None:
        """Forget the libraries that this process has loaded."""
        self._monkeypatch.setattr(library, "_LOADED", {})

    def files(self) -> list[Path]:
        return sorted(self.folder.iterdir())

    def _compile(self, texts: Mapping[str, str]) -> bytes:
        self.compiled += 1
        if (key := str(texts)) not in _MADE:
            _MADE[key] = compile_engine(texts)
        return _MADE[key]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cache:
    return Cache(tmp_path / "cache", monkeypatch)


def test_it_is_compiled_once_for_all_numbers_of_a_kind_of_vehicle(cache: Cache) -> None:
    load_library(ROV)
    cache.restart()
    load_library(ROV.with_(**{name: 2.0 * value for name, value in ROV.coefficients.items()}))
    assert cache.compiled == 1
    assert len(cache.files()) == 1
    load_library(VEHICLES["yaw only"])
    assert cache.compiled == 2
    assert len(cache.files()) == 2


@pytest.mark.parametrize("damage", [lambda content: content[:1000], lambda content: content[:-1] + b"?"])
def test_a_damaged_library_is_compiled_again(cache: Cache, damage: Callable[[bytes], bytes]) -> None:
    load_library(ROV)
    (file,) = cache.files()
    content = file.read_bytes()
    file.unlink()  # the old file is still loaded and must not change
    file.write_bytes(damage(content))
    cache.restart()
    load_library(ROV)
    assert cache.compiled == 2
    assert cache.files() == [file]
    assert file.read_bytes() == content


def test_without_a_cache_folder_it_is_compiled_for_this_process(
    cache: Cache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cache").write_text("a file, so no folder can be made there")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    assert isinstance(load_library(ROV), ctypes.CDLL)
    assert cache.compiled == 1
    if os.name == "posix":  # Windows does not remove a library that is loaded
        assert list((tmp_path / "temporary").iterdir()) == []


def test_without_a_compiler_one_line_says_so(cache: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else found(name))
    monkeypatch.setattr(library, "compile_engine", compile_engine)
    with pytest.raises(BuildError, match=r"^the C compiler is missing: pip install ziglang$"):
        load_library(ROV)
    assert cache.files() == []
