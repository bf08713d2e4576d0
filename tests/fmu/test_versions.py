"""An FMU of one interface or both, and of some platforms, says what it has and what an importer must do."""

from pathlib import Path

import fmpy
import pytest
from lxml import etree

import rov_fmu
from rov_fmu.c import compile as build_options
from rov_fmu.cli import main
from rov_fmu.fmu.content import native_content
from rov_fmu.fmu.model_description import DEAD_TIME_NOTE, PYTHON_NOTE, model_description, model_of
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE, Capsys
from tests.fmi import CO_SIMULATION, INTERFACES, MODEL_EXCHANGE
from tests.fmu.calls.conftest import WRAPPERS
from tests.vehicles import HEAVY, THRUST_EFFECTS, a_vehicle


def test_the_description_says_what_an_importer_must_do() -> None:
    rov, one = load_vehicle(THRUST_EFFECTS), a_vehicle(HEAVY)
    for of, interface, is_native, notes in (
        *((rov, interface, True, [DEAD_TIME_NOTE]) for interface in ("me", "both")),
        (rov, "cs", True, []),
        (one, "both", True, []),
        (one, "cs", False, [PYTHON_NOTE]),
    ):
        offered = build_options.INTERFACES[interface]
        xml = model_description(model_of(of), guid="", interfaces=offered, native=is_native)
        assert etree.fromstring(xml).get("description") == ". ".join([of.summary, *notes])


# ---- rov-fmu build --interface ----

KINDS = {"cs": (CO_SIMULATION, MODEL_EXCHANGE), "me": (MODEL_EXCHANGE, CO_SIMULATION)}
"""The kind of instance that an FMU offers, and the one that it refuses."""


@pytest.mark.parametrize(
    ("platforms", "systems"),
    [
        (["linux64"], ["Linux"]),
        (["win64", "aarch64-linux"], ["Linux", "Windows"]),
        ([*build_options.PLATFORMS], ["Linux", "Windows", "macOS"]),
    ],
)
def test_an_fmu_lists_what_its_own_binaries_need(platforms: list[str], systems: list[str], vehicle: Vehicle) -> None:
    content = native_content(vehicle, fmi=3, platforms=platforms)
    _, _, *lines = content.files["documentation/externalDependencies.txt"].decode().splitlines()
    assert [line.split()[0] for line in lines] == systems


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_description_has_the_elements_of_the_interface_and_its_own_guid(fmi: int, vehicle: Vehicle) -> None:
    contents = {name: native_content(vehicle, fmi=fmi, interface=name) for name in build_options.INTERFACES}
    for name, kinds in build_options.INTERFACES.items():
        root = etree.fromstring(contents[name].files["modelDescription.xml"])
        assert tuple(one.tag for one in root if one.tag in ("ModelExchange", "CoSimulation")) == kinds
        assert [file.get("name") for file in root.iter("File")] == ["fmu.c"] * len(kinds) * (fmi == 2)
    assert len({content.guid for content in contents.values()}) == 3
    assert contents["both"] == native_content(vehicle, fmi=fmi)


@pytest.mark.long
@pytest.mark.parametrize("interface", KINDS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_of_one_interface_runs_proves_itself_and_refuses_the_other(
    fmi: int, interface: str, tmp_path: Path, capsys: Capsys
) -> None:
    path, folder = tmp_path / "bare.fmu", tmp_path / "bare"
    options = ["--fmi", str(fmi), "--interface", interface, "--platform", "host", "-o", str(path)]
    assert main(["build", str(BARE), *options]) == 0
    assert "The FMU is valid. In a run, " in capsys.readouterr().out
    assert main(["prove", str(path)]) == 0
    name = {CO_SIMULATION: "co-simulation", MODEL_EXCHANGE: "model-exchange"}
    offered, refused = KINDS[interface]
    assert main(["prove", str(path), "--interface", name[refused]]) == 2
    assert f"has no {name[refused]}, only {name[offered]}\n" in capsys.readouterr().err
    fmpy.extract(str(path), unzipdir=str(folder))
    page = (folder / "documentation" / "index.html").read_text(encoding="utf-8")
    assert f"<dt>{INTERFACES[offered]}</dt>" in page
    assert f"<dt>{INTERFACES[refused]}</dt>" not in page
    (library,) = (folder / "binaries").glob("*/*")
    fmu = WRAPPERS[fmi](folder, library)
    with fmu.instance(offered) as rov:
        rov.start()
    with pytest.raises(AssertionError, match=f"this FMU is for {INTERFACES[offered]} only"):
        fmu.instance(refused)


def test_an_interface_that_an_fmu_cannot_have_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    for options, line in (
        (["--backend", "pythonfmu", "--interface", "me"], "--interface me: PythonFMU makes Co-Simulation (cs) alone"),
        (["--interface", "model-exchange"], "must be one of cs, me, both; did you mean me?"),
    ):
        assert main(["build", str(BARE), *options]) == 2
        err = capsys.readouterr().err
        assert line in err
        assert err.count("\n") == 1
    with pytest.raises(build_options.OptionError, match="there is no interface 'ms', only cs, me, both"):
        rov_fmu.load(BARE).build("bare.fmu", interface="ms")
    assert not [*tmp_path.iterdir()]
