"""The archive that a build writes."""

import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

import rov_fmu
from rov_fmu.build import chosen_platforms
from rov_fmu.c import compile as fmu_compile
from rov_fmu.cli import main
from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.vehicle import Vehicle
from tests.commands import BARE, Capsys, python
from tests.conftest import compile_anew


def test_the_fmu_is_valid_and_reaches_the_speed_of_table_9(either_fmu: Path) -> None:
    assert validate_fmu(str(either_fmu)) == []
    for interface in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(str(either_fmu), fmi_type=interface, start_values={"u_l": 0.3, "u_r": 0.3})
        assert round(float(result["u"][-1]), 4) == 0.4729


def test_every_importer_can_unpack_the_archive(either_fmu: Path) -> None:
    with zipfile.ZipFile(either_fmu) as archive:
        assert archive.testzip() is None
        members = archive.infolist()
    names = [m.filename for m in members]
    assert names[0] == "modelDescription.xml"
    assert {
        "model.png",
        "documentation/index.html",
        "documentation/diagram.png",
        "documentation/licenses/license.txt",
        "sources/fmu.c",
        "sources/interface.h",
        "terminalsAndIcons/terminalsAndIcons.xml",
    } <= set(names)
    headers = {path.name for path in fmu_compile.fmi_headers().glob("*.h")}
    assert len(headers) > 6
    assert not [n for n in names if Path(n).name in headers], "they are the importer's"
    for m in members:
        assert m.compress_type == zipfile.ZIP_DEFLATED
        assert m.create_system == 3
        assert m.extract_version <= 20
        assert m.date_time == (1980, 1, 1, 0, 0, 0)
        assert "\\" not in m.filename
        assert m.external_attr >> 16 == 0o644  # a file, not a link
        assert not m.flag_bits & 0x1


def test_by_default_an_fmu_has_all_platforms_of_64_bits() -> None:
    x64 = ["linux64", "aarch64-linux", "win64", "darwin64", "aarch64-darwin"]
    assert chosen_platforms(None) == chosen_platforms(()) == x64
    assert {*fmu_compile.PLATFORMS} - {*x64} == {"linux32", "win32"}


@pytest.mark.usefixtures("without_page")
def test_platforms_that_are_lost_and_those_that_cannot_be_run_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    def compiled(
        platforms: Sequence[str], _: object, __: str, done: Callable[[str], None], ___: int
    ) -> dict[str, bytes]:
        for name in platforms:
            done(name)
        return dict.fromkeys(platforms, bytes(7))

    monkeypatch.setattr("rov_fmu.build.compile_all", compiled)
    path = tmp_path / "x.fmu"
    for before in (("win64", "linux64", "darwin64"), ("linux64",)):
        with zipfile.ZipFile(path, "w") as archive:
            for name in ("modelDescription.xml", *(f"binaries/{folder}/x.so" for folder in before)):
                archive.writestr(name, "")
        built = rov_fmu.load(BARE).build(path, platforms="linux32", force=True)
        assert [*built.lost] == sorted(before)
        assert (built.path, built.size, dict(built.binaries)) == (path, path.stat().st_size, {"linux32": 7})
        assert 0.0 <= built.seconds["linux32"] < 60.0
        with zipfile.ZipFile(path) as archive:
            assert archive.read("binaries/linux32/bare.so") == bytes(7)
        assert not built.was_run
        assert built.note.startswith("The FMU is valid. It was not run, because it has no binary that FMPy loads")
    monkeypatch.setattr("rov_fmu.build._check", lambda *_: ("", True))
    assert main(["build", str(BARE), "--platform", "linux64", "--platform", "darwin64", "-o", str(path)]) == 0
    assert capsys.readouterr().out.startswith(f"Replaced {path}, which also had linux32.\n")


@pytest.mark.long
def test_a_second_build_gives_the_same_bytes_and_says_what_it_built(
    either_fmu: Path,
    fmi: int,
    tmp_path: Path,
    capsys: Capsys,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fmu_compile._Library, "compile", compile_anew)
    again = tmp_path / "elsewhere" / "other name.fmu"
    again.parent.mkdir()
    assert main(["build", "--fmi", str(fmi), "--platform", "host", "-o", str(again)]) == 0
    assert again.read_bytes() == either_fmu.read_bytes()
    assert list(again.parent.iterdir()) == [again]
    output = capsys.readouterr().out
    assert str(fmu_compile.host_platform(fmi)) in output
    assert "The FMU is valid. In a run, u_l = u_r = 0.3 gives u = 0.4729 m/s after 10 s." in output
    assert "built in" in output


def test_another_coefficient_gives_another_guid(videoray_fmu: Path, vehicle: Vehicle) -> None:
    guid = fmpy.read_model_description(str(videoray_fmu)).guid
    assert native_content(vehicle).guid == guid
    assert native_content(vehicle.with_(m_rov=6.58)).guid != guid


def test_after_a_build_fmpy_prints_what_an_fmu_says(videoray_fmu: Path) -> None:
    """The logger of the build's own run is gone then, and FMPy 0.3 would call it (in a process that may crash)."""
    program = (
        "import fmpy, gc, sys, rov_fmu\nfrom pathlib import Path\nfrom rov_fmu.build import _check\n"
        "path = Path(sys.argv[1])\n_check(path, rov_fmu.load('videoray'), None, 2)\ngc.collect()\n"
        "fmpy.simulate_fmu(str(path), start_values={'u_t': -0.5}, stop_time=1.0)\n"
    )
    assert "the vehicle has left the water" in python("-c", program, str(videoray_fmu))
