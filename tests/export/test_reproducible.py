"""The same vehicle file gives the same FMU to the byte: from another folder, by another Python."""

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from checks.commands import ROOT

_BUILDS = {"native": ("--platform", "linux64", "--platform", "win64"), "pythonfmu": ("--backend", "pythonfmu")}
_OTHERS = [f"3.{minor}" for minor in range(10, 15) if minor != sys.version_info.minor]


def _built(python: str, folder: Path) -> dict[str, str]:
    """Build both flavours with a Python; their hashes."""
    hashes = {}
    for name, arguments in _BUILDS.items():
        fmu = folder / f"{name}.fmu"
        command = [python, str(ROOT / "build_fmu.py"), *arguments, "-o", str(fmu)]
        subprocess.run(command, check=True, capture_output=True, cwd=folder)
        hashes[name] = hashlib.sha256(fmu.read_bytes()).hexdigest()
    return hashes


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return _built(sys.executable, tmp_path_factory.mktemp("here"))


def test_built_in_another_folder(here: dict[str, str], tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "er and other"
    folder.mkdir(parents=True)
    assert _built(sys.executable, folder) == here


def _interpreter(version: str) -> str | None:
    """An interpreter of a version, if there is one that starts."""
    installed = [str(path) for path in Path.home().glob(f".pyenv/versions/{version}.*/bin/python")]
    for candidate in [shutil.which(f"python{version}"), *installed]:
        if candidate and subprocess.run([candidate, "--version"], capture_output=True, check=False).returncode == 0:
            return candidate
    return None


@pytest.mark.long
@pytest.mark.parametrize("version", _OTHERS)
def test_built_by_another_python(here: dict[str, str], tmp_path: Path, version: str) -> None:
    interpreter = _interpreter(version)
    if interpreter is None:
        pytest.skip(f"there is no Python {version} here")
    subprocess.run([interpreter, "-m", "venv", str(tmp_path / "venv")], check=True)
    python = str(tmp_path / "venv" / "bin" / "python")
    install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-e", str(ROOT)]
    subprocess.run([python, *install], check=True)
    assert _built(python, tmp_path) == here
