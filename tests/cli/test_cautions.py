"""What a vehicle file says against its own use is told by each command and in each file that the vehicle goes into."""

import re
import warnings
import zipfile
from io import BytesIO
from pathlib import Path
from shlex import split

import pytest

import rov_fmu
from rov_fmu.bridges import mujoco
from rov_fmu.bridges.autopilot import files as autopilot_export
from rov_fmu.bridges.autopilot.fmu import autopilot_fmu
from rov_fmu.c.compile import host_platform
from rov_fmu.cli import main
from rov_fmu.interface.export_command import EXPORTS
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleWarning, load_vehicle
from tests.commands import FILES, WRITING, Capsys

WORDS = "not every axis may be trusted (surge: do not use, yaw: not identified), and harbour.html has the reasons"
TESTED = "tests had commands of surge from -30% to 40%, and none beyond"
CAUTION = f"{WORDS}; {TESTED}"
VEHICLE = (
    SHIPPED["bluerov2"]
    .read_text(encoding="utf-8")
    .replace("[validity]", "[validity]\ntested = { surge = [-0.3, 0.4] }", 1)
)
VEHICLE += """
[provenance]
tool = "rov-fmu"
method = "a fit"
report = "harbour.html"
verdicts = ["surge: do not use: it is off by 40 %.", "sway: good.", "heave: usable."]
inputs = {}
"""
SYSTEM = 'step = 0.1\nstop_time = 1.0\n[component.rov]\nvehicle = "harbour.toml"\n'
STUDY = 'vehicle = "harbour.toml"\nstop_time = 1.0\nstep = 0.1\nsampler = "grid"\n[figures]\nfar = "max(u)"\n'
LOG = "time [s],1 [%],heave velocity [m/s]\n" + "".join(f"{n / 10},20,0.1\n" for n in range(60))

TELLING = {
    ("build", "vehicle"): "build harbour.toml --platform host -o rov.fmu",
    ("simulate", "vehicle"): "simulate harbour.toml -o run.csv",
    ("fly", "vehicle"): "fly harbour.toml -o fly.html",
    ("fly", "against"): "fly bluerov2 --against harbour.toml -o fly.html",
    ("sitl", "vehicle"): "sitl harbour.toml --port 0 --duration 0.01",
    ("system", "plan"): "system system.toml -o rov.ssp",
    ("study", "plan"): "study study.toml -o results",
    ("inspect", "tests"): "inspect logs/dive.csv",
    ("tune", "vehicle"): "tune harbour.toml --axis heave --command 0.3 --v-ss 0.2 -o tuned.toml",
}
"""The arguments and options of commands by which a vehicle comes in, but for those of `export`."""
TELLING |= {("simulate", "--find"): "simulate harbour.toml --find heave=0.3"}
TELLING |= {("export", to): f"export harbour.toml --to {to}" for to in EXPORTS}
SILENT = {
    ("simulate", "vehicle"),
    ("simulate", "--find"),
    ("sitl", "vehicle"),
    ("inspect", "tests"),
    ("tune", "vehicle"),
}
"""They write no file for people, or one that has the verdicts themselves."""
HEADS = ("README.md", ".yaml", ".param", ".params", ".sdf", ".urdf", "modelDescription.xml", "model_card.txt")
"""How the names of files end that say it in their first lines."""
PAGES = ("index.html", "fly.html")
"""The pages that say it above everything else."""
IDENTIFY = {("identify", "tests"), ("identify", "base")}
"""Their vehicle is only a beginning. They are tested alone, because a fit takes long."""
WITHOUT = {
    ("list", "folder"),  # those that ship
    ("simulate", "commands"),
    ("fly", "recording"),
    ("export", "vehicle"),  # above, for each format
    ("export", "gains"),
    ("prove", "fmu"),
    ("tune", "points"),
}
"""The other arguments and options that name files that are read."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a vehicle that its own file warns of, and with plans and a log that name it."""
    monkeypatch.setattr(mujoco, "HOSTS", [*filter(None, [host_platform(fmi=3)])])
    here = [*filter(None, [host_platform()])]
    monkeypatch.setattr(autopilot_export, "autopilot_fmu", lambda made, fmi: autopilot_fmu(made, here, fmi))
    texts = {"harbour.toml": VEHICLE, "harbour.html": "<p>", "system.toml": SYSTEM, "study.toml": STUDY}
    texts |= {"logs/rov.toml": 'base = "harbour.toml"\n', "logs/dive.csv": LOG, "logs/harbour.toml": VEHICLE}
    texts |= {"logs/harbour.html": "<p>"}
    (tmp_path / "logs").mkdir()
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_no_command_that_reads_a_vehicle_is_missing_here() -> None:
    assert TELLING.keys() | IDENTIFY | WITHOUT == (FILES.keys() - WRITING.keys()) | {
        ("simulate", "--find"),
        *(("export", to) for to in EXPORTS),
    }


@pytest.mark.parametrize("case", TELLING, ids=" ".join)
def test_a_command_tells_the_caution_in_a_line_and_at_the_head_of_what_it_writes(
    case: tuple[str, str], folder: Path, capsys: Capsys
) -> None:
    before = {*folder.rglob("*")}
    assert main(split(TELLING[case])) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if WORDS in line]
    assert [line.partition("harbour.toml")[2] for line in told] == [f": {CAUTION}"]
    assert told[0].startswith("rov-fmu: warning: ")
    new = sorted({*folder.rglob("*")} - before)
    texts = dict(_texts({path.name: path.read_bytes() for path in new if path.is_file()}))
    found = {name: re.sub(r"\s+", " ", text).find(WORDS) for name, text in texts.items()}
    if case not in SILENT:
        assert any(at >= 0 for at in found.values()), "a file says it"
    assert [name for name, at in found.items() if name.endswith(HEADS) and not 0 <= at < 900] == []
    pages = (name for name in texts if name.endswith(PAGES))
    assert [name for name in pages if WORDS not in texts[name].partition("<main")[0]] == []


@pytest.mark.parametrize("to", ["log.csv --base harbour.toml", "logs"])
def test_an_identification_tells_the_caution_of_its_base(to: str, folder: Path, capsys: Capsys) -> None:
    (folder / "log.csv").write_text("time [s],1 [%],heave velocity [m/s]\n0,20,0.1\n", encoding="utf-8")
    (folder / "logs" / "dive.csv").write_text("time [s],1 [%],heave velocity [m/s]\n0,20,0.1\n", encoding="utf-8")
    assert main(["identify", *split(to)]) == 2  # a log of one row; the base is read before
    assert capsys.readouterr().err.count(f"harbour.toml: {CAUTION}\n") == 1


def _texts(files: dict[str, bytes], above: str = "") -> list[tuple[str, str]]:
    """Return the texts of files, and of those in archives, by their names."""
    found = []
    for name, content in files.items():
        if content.startswith(b"PK"):
            with zipfile.ZipFile(BytesIO(content)) as archive:
                found += _texts({one: archive.read(one) for one in archive.namelist()}, f"{above}{name}/")
        else:
            found.append((above + name, content.decode("utf-8", "replace")))
    return found


def test_python_warns_by_a_class_of_its_own(folder: Path) -> None:
    with pytest.warns(VehicleWarning, match=re.escape(CAUTION)):
        vehicle = rov_fmu.load("harbour.toml")
    with warnings.catch_warnings():  # once it is loaded, it has been told
        warnings.simplefilter("error")
        vehicle.with_(m_rov=12.0).simulate(1.0)
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        other = load_vehicle(folder / "harbour.toml")
    with pytest.warns(VehicleWarning, match=f"^bluerov2: {re.escape(CAUTION)}"):
        rov_fmu.load(other)


def test_a_vehicle_that_ships_needs_no_caution() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert {name: load_vehicle(path).caution for name, path in SHIPPED.items()} == dict.fromkeys(SHIPPED, "")


def test_a_good_vehicle_is_loaded_without_a_word_and_its_files_tell_up_to_where_it_was_tested(folder: Path) -> None:
    (folder / "harbour.toml").write_text(
        VEHICLE.replace("do not use", "usable").replace('"heave: usable."', '"heave: usable.", "yaw: good."'), "utf-8"
    )
    vehicle = rov_fmu.load("harbour.toml")
    assert (vehicle.doubts, vehicle.caution) == ([], TESTED)
    assert main(["export", "harbour.toml", "--to", "gains"]) == 0
    assert f"# Caution: {TESTED}.\n" in (folder / "bluerov2_gains" / "gains.yaml").read_text(encoding="utf-8")
