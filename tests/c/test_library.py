"""The library of the engine is compiled once for each layout, and never loaded when it is damaged or foreign."""

import ctypes
import importlib.util
import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace

import pytest

from rov_fmu.c import compile as compile_module
from rov_fmu.c import library
from rov_fmu.c.compile import BuildError, compile_engine
from rov_fmu.c.library import load_library
from rov_fmu.io.paths import is_own_file
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
    with pytest.warns(
        UserWarning, match=f"^{cache.folder}: the compiled engine cannot be kept there: Not a directory. "
    ):
        assert isinstance(load_library(ROV), ctypes.CDLL)
    assert cache.compiled == 1
    if os.name == "posix":  # Windows does not remove a library that is loaded
        assert list((tmp_path / "temporary").iterdir()) == []


def _linked_to_others(engine: Path) -> None:
    engine.chmod(0o777)
    engine.rename(engine.parent / "real")
    engine.symlink_to("real")


FOREIGN: dict[str, tuple[Callable[[Path], object], str]] = {
    "the folder belongs to another user": (lambda engine: os.chown(engine, 4321, -1), "{0} belongs to another user"),
    "everybody can write the folder": (lambda engine: engine.chmod(0o777), "other users can write {0}"),
    "a sticky folder": (lambda engine: engine.chmod(0o1777), "other users can write {0}"),
    "its group can write the folder": (lambda engine: engine.chmod(0o770), "other users can write {0}"),
    "the folder above it belongs to another user": (
        lambda engine: os.chown(engine.parent, 4321, -1),
        "{1} belongs to another user",
    ),
    "everybody can write the folder above it": (lambda engine: engine.parent.chmod(0o777), "other users can write {1}"),
    "a link to such a folder": (
        _linked_to_others,
        "other users can write {1}/real",
    ),
}


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("name", FOREIGN)
def test_a_library_is_loaded_from_no_folder_that_another_user_can_change(name: str, cache: Cache) -> None:
    change, said = FOREIGN[name]
    load_library(ROV)
    (file,) = cache.files()
    change(cache.folder)
    cache.restart()
    reason = re.escape(said.format(cache.folder, cache.folder.parent))
    with pytest.warns(
        UserWarning, match=rf"^{cache.folder}: the compiled engine cannot be kept there: {reason}\. It is"
    ):
        load_library(ROV)
    assert cache.compiled == 2
    assert cache.files() == [file]


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root can give files away")
def test_the_compiler_finds_nothing_in_a_folder_that_another_user_can_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder := tmp_path / "zig").mkdir()
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(folder))
    assert compile_module._cache() == str(folder)
    os.chown(folder, 4321, -1)
    with pytest.warns(
        UserWarning, match=f"^{folder}: the compiler's cache cannot be there: {folder} belongs to another"
    ):
        assert compile_module._cache() == compile_module._temporary_cache()
    assert Path(compile_module._temporary_cache()).stat().st_mode & 0o777 == 0o700


def test_a_sticky_folder_above_the_cache_is_as_good_as_tmp(cache: Cache) -> None:
    cache.folder.mkdir(parents=True)
    cache.folder.parent.chmod(0o1777)
    load_library(ROV)
    assert len(cache.files()) == 1


def _linked(file: Path) -> None:
    file.rename(elsewhere := file.parent.parent / "elsewhere")
    file.symlink_to(elsewhere)


NOT_OURS: dict[str, Callable[[Path], object]] = {
    "another user wrote it": lambda file: os.chown(file, 4321, -1),
    "everybody can write it": lambda file: file.chmod(0o666),
    "its group can write it": lambda file: file.chmod(0o660),
    "a link": _linked,
}


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("name", NOT_OURS)
def test_a_library_that_another_user_could_have_written_is_compiled_again(name: str, cache: Cache) -> None:
    load_library(ROV)
    (file,) = cache.files()
    NOT_OURS[name](file)
    cache.restart()
    load_library(ROV)
    assert cache.compiled == 2
    assert cache.files() == [file]
    assert is_own_file(file), "it was replaced"
    cache.restart()
    load_library(ROV)
    assert cache.compiled == 2


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no umask")
def test_any_umask_makes_folders_and_files_of_this_user_alone(cache: Cache) -> None:
    before = os.umask(0)
    try:
        load_library(ROV)
    finally:
        os.umask(before)
    assert [path.stat().st_mode & 0o077 for path in (cache.folder.parent, cache.folder, *cache.files())] == [0, 0, 0]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no groups of this kind")
@pytest.mark.parametrize(
    ("group", "members", "is_own"), [("ann", [], True), ("ann", ["bob"], False), ("lab", [], False)]
)
def test_the_private_group_of_a_user_is_nobody_else(
    group: str, members: list[str], is_own: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ubuntu gives every user such a group, which may write new files."""
    import grp
    import pwd

    (file := tmp_path / "file").touch()
    file.chmod(0o664)
    monkeypatch.setattr(pwd, "getpwuid", lambda _: SimpleNamespace(pw_uid=1000, pw_name="ann"))
    monkeypatch.setattr(grp, "getgrgid", lambda _: SimpleNamespace(gr_name=group, gr_mem=members))
    assert is_own_file(file) == is_own


def test_without_a_compiler_one_line_says_so(cache: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else found(name))
    monkeypatch.setattr(library, "compile_engine", compile_engine)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(BuildError, match=r"^the C compiler is missing: pip install ziglang, or put"):
        load_library(ROV)
    assert cache.files() == []
