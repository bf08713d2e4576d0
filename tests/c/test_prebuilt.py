"""What a wheel has compiled is used for the sources that it was compiled from, and for no others."""

from pathlib import Path

import pytest

from rov_fmu.build import build_fmu
from rov_fmu.c import library, prebuilt
from rov_fmu.c.compile import BuildError, compile_engine, host_platform
from rov_fmu.fmu import content
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE
from tests.conftest import without_page

HOST = host_platform(fmi=3) or ""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of prebuilt files."""
    monkeypatch.setattr(prebuilt, "PREBUILT", tmp_path)
    return tmp_path


@pytest.fixture
def no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without a compiler and with an empty cache."""
    monkeypatch.setattr(library, "_LOADED", {})
    monkeypatch.setattr(library, "user_cache_path", lambda *_, **__: tmp_path / "cache")

    def missing(*_: object) -> bytes:
        raise BuildError("there is no compiler")

    monkeypatch.setattr(library, "compile_engine", missing)
    monkeypatch.setattr(content, "compile_module", missing)


@pytest.mark.usefixtures("no_compiler")
def test_an_engine_is_taken_for_its_sources_alone(folder: Path) -> None:
    rov, other = load_vehicle(VIDEORAY), load_vehicle(SHIPPED["bluerov2"])
    sources = library.engine_sources(rov.layout)
    prebuilt.prebuilt_path(folder, HOST, sources).write_bytes(compile_engine(sources, HOST))
    assert library.load_library(rov).simulate
    with pytest.raises(BuildError, match="there is no compiler"):
        library.load_library(other)


@pytest.mark.usefixtures("no_compiler")
def test_the_module_of_a_page_is_taken_for_its_sources_alone(folder: Path) -> None:
    layout, other = load_vehicle(VIDEORAY).layout, load_vehicle(SHIPPED["bluerov2"]).layout
    prebuilt.prebuilt_path(folder, prebuilt.MODULE, content.module_sources(layout)).write_bytes(b"of the wheel")
    assert content.web_module(layout) == b"of the wheel"
    with pytest.raises(BuildError, match="there is no compiler"):
        content.web_module(other)


@pytest.mark.long
def test_binaries_are_taken_for_their_guid_alone(folder: Path, tmp_path: Path) -> None:
    rov = load_vehicle(BARE)
    with without_page():
        build_fmu(rov, folder / "bare.fmu", platforms="host")
        same = build_fmu(rov, tmp_path / "same.fmu", platforms="host")
        changed = build_fmu(rov.with_(m_rov=2.0 * rov["m_rov"]), tmp_path / "changed.fmu", platforms="host")
    assert not same.seconds
    assert same.was_run
    assert changed.seconds.keys() == changed.binaries.keys()
    assert changed.guid != same.guid
