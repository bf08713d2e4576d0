"""What `pip install rov-fmu` puts on a machine, and that it is enough: no checkout, no compiler but ziglang."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

from rov_fmu import __version__
from rov_fmu.build import build_fmu
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, FEW_TESTS, ROOT
from tests.conftest import Made
from verification.fresh_environment import Environment, environment

CONSTRAINTS = ROOT / "constraints.txt"
_PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")


def built(kind: str, folder: Path, *, prebuilt: bool = False) -> Path:
    """Build the wheel or the sdist of this checkout, and return its path. A wheel without prebuilt files is quick."""
    own = os.environ | ({} if prebuilt else {"HATCH_BUILD_NO_HOOKS": "true"})
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    subprocess.run(command, check=True, cwd=ROOT, env=own)
    (path,) = folder.glob("*.whl" if kind == "wheel" else "*.tar.gz")
    return path


def pinned_environment(made_once: Made, factory: pytest.TempPathFactory) -> Environment:
    """Return the environment of this Python with the wheel and the versions of constraints.txt, made once in a run."""

    def fill(folder: Path) -> None:
        place = factory.mktemp("pinned")  # its programs contain its path, so that it cannot be moved
        environment(place, "-c", CONSTRAINTS, built("wheel", place / "dist"))
        (folder / "place").write_text(str(place), encoding="utf-8")

    return Environment(Path((made_once("pinned environment", fill) / "place").read_text(encoding="utf-8")))


def interpreter(version: str) -> str | None:
    """Return an interpreter of a version, if there is one that starts."""
    installed = [str(path) for path in Path.home().glob(f".pyenv/versions/{version}.*/bin/python")]
    for candidate in [shutil.which(f"python{version}"), *installed]:
        if candidate and subprocess.run([candidate, "--version"], capture_output=True, check=False).returncode == 0:
            return candidate
    return None


def _files(folder: str) -> set[str]:
    """Return the files in a folder of the checkout, without caches of Python and without README files."""
    files = (path for path in (ROOT / folder).rglob("*") if path.is_file())
    kept = (path for path in files if path.parent.name != "__pycache__" and path.name != "README.md")
    return {path.relative_to(ROOT).as_posix() for path in kept}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("wheel", tmp_path_factory.mktemp("wheel"))


def _content(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_the_wheel_holds_the_package_and_its_data_alone(wheel: Path) -> None:
    names = _content(wheel).keys()
    assert {name.split("/")[0] for name in names} == {"rov_fmu", f"rov_fmu-{__version__}.dist-info"}
    ours = [name for name in names if name.startswith("rov_fmu/")]
    assert not [n for n in ours if re.search(r"__pycache__|README|\.pyc|\.fmu$|/\.", n)]
    data = {n.removeprefix("rov_fmu/data/") for n in ours if n.startswith("rov_fmu/data/")}
    assert data == {*_files("fmu_src"), *_files("models"), "LICENSE"}
    assert set(ours) - {f"rov_fmu/data/{n}" for n in data} == _files("rov_fmu")
    assert "rov_fmu/py.typed" in ours


@pytest.mark.weekly
def test_the_installed_command_does_everything_outside_the_checkout(
    made_once: Made, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    made, here = pinned_environment(made_once, tmp_path_factory), tmp_path / "here"
    here.mkdir()
    shutil.copytree(FEW_TESTS, here / "tests")
    for command, expected in (
        ("rov-fmu build --platform host", "videoray.fmu"),
        ("fmpy simulate videoray.fmu --start-values u_l 0.3 u_r 0.3", ""),
        ("rov-fmu simulate videoray --find surge=0.5", "thrust"),
        ("rov-fmu identify tests -o tests/found.toml --report tests/found.html", ""),
    ):
        assert expected in made.run(*command.split(), where=here)


@pytest.fixture(scope="module")
def full_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("wheel", tmp_path_factory.mktemp("full wheel"), prebuilt=True)


@pytest.mark.weekly
def test_the_fmus_in_the_wheel_are_those_of_a_build(full_wheel: Path, tmp_path: Path) -> None:
    inside = {Path(name).name: content for name, content in _content(full_wheel).items() if name.endswith(".fmu")}
    assert {*inside} == {f"{name}.fmu" for name in SHIPPED}
    for name, file in SHIPPED.items():
        own = build_fmu(load_vehicle(file), tmp_path / f"{name}.fmu")
        assert own.seconds.keys() == own.binaries.keys(), "all of it was compiled"
        assert own.path.read_bytes() == inside[f"{name}.fmu"]


@pytest.mark.weekly
def test_vehicles_that_ship_need_no_compiler(full_wheel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pinned = [line.partition("==")[0] for line in CONSTRAINTS.read_text("utf-8").splitlines() if "==" in line]
    same = tmp_path / "same.txt"  # the versions that the wheel was built with here
    same.write_text("".join(f"{name}=={version(name)}\n" for name in pinned), encoding="utf-8")
    made, here = environment(tmp_path / "venv", "-c", same, full_wheel), tmp_path / "here"
    (link,) = made.folder.glob("lib/python3*/site-packages/ziglang")
    link.unlink() if link.is_symlink() else shutil.rmtree(link)
    here.mkdir()
    for variable in ("XDG_CACHE_HOME", "ZIG_GLOBAL_CACHE_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / "empty cache"))
    for name in SHIPPED:
        made.run("rov-fmu", "fly", name, "-o", f"{name}.html", where=here)
        assert "after 10 s" in " ".join(made.run("rov-fmu", "simulate", name, where=here).split())
        assert "The FMU is valid" in made.run("rov-fmu", "build", name, "-o", f"{name}.fmu", where=here)
        assert (here / f"{name}.fmu").read_bytes() == _content(full_wheel)[f"rov_fmu/data/prebuilt/{name}.fmu"]
    made.run("fmpy", "simulate", "videoray.fmu", "--output-file", "result.csv", where=here)
    shutil.copy(BARE, here / "own.toml")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(subprocess.CalledProcessError) as failed:
        made.run("rov-fmu", "build", "own.toml", where=here, stderr=subprocess.PIPE)
    assert failed.value.stderr.startswith("rov-fmu: the C compiler is missing: pip install ziglang, or put ")


@pytest.mark.weekly
def test_the_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HATCH_BUILD_NO_HOOKS", "true")
    sdist = built("sdist", tmp_path / "sdist")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"tests/cli/test_wheel.py", "constraints.txt", "build_fmu.py", "LICENSE", "README.md"} <= names
    subprocess.run([sys.executable, *_PIP, "wheel", "--no-deps", "-w", tmp_path / "again", sdist], check=True)
    (again,) = (tmp_path / "again").iterdir()
    assert _content(again) == _content(wheel)


def lowest(folder: Path, *keys: str) -> Path:
    """A file of requirements: those in these lists of pyproject.toml, at their lower bounds."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    lists = [re.search(rf"^{key} = \[\n(.*?)^\]", text, re.M | re.S) for key in keys]
    needed = "".join(found[1] for found in lists if found)
    pins = [f"{name}=={bound}" for name, bound in re.findall(r'^    "([A-Za-z0-9-]+)>=([0-9.]+)', needed, re.M)]
    assert all(lists)
    path = folder / "lowest.txt"
    path.write_text("\n".join(pins) + "\n", encoding="utf-8")
    return path


PARTS = [
    "cli/test_start.py",
    "fmu/test_build.py",
    "fmu/test_properties.py",
    "report",
    "vehicle/test_vehicle.py",
    *(f"vehicle/test_{part}.py" for part in ("writer", "json_schema", "bluerov2")),
    *(f"identify/test_{part}.py" for part in ("identify", "refit", "tuning")),
    "study",
]
"""Tests of every part that uses a dependency."""


@pytest.mark.weekly
def test_the_lowest_versions_are_enough(tmp_path: Path) -> None:
    python = interpreter("3.10")
    if python is None:
        pytest.skip("there is no Python 3.10 here")
    pins = lowest(tmp_path, "dependencies", "study")
    made = environment(tmp_path / "venv", "-c", pins, f"{ROOT}[test]", python=python)
    command = [made.python, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", *(f"tests/{part}" for part in PARTS)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-3000:]
