"""What a release contains: two equal builds, sums, and inventories that validate."""

import hashlib
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import build_backend
from rov_fmu.build import build_fmu
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, ROOT
from verification import release


def valid(inventory: str) -> bool:
    """Return True if an inventory keeps to its schema. The import takes a second, which not all processes need."""
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    return JsonStrictValidator(SchemaVersion.V1_6).validate_str(inventory) is None


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU that builds quickly."""
    path = tmp_path_factory.mktemp("release") / "bare.fmu"
    build_fmu(load_vehicle(BARE), path, platforms="host")
    return path


@pytest.mark.weekly
def test_the_inventory_of_an_fmu_names_every_file(fmu: Path) -> None:
    text = release.fmu_inventory(fmu)
    assert valid(text)
    assert text == release.fmu_inventory(fmu)
    inventory = json.loads(text)
    assert inventory["metadata"]["component"]["hashes"][0]["content"] == hashlib.sha256(fmu.read_bytes()).hexdigest()
    with zipfile.ZipFile(fmu) as archive:
        expected = {name: hashlib.sha256(archive.read(name)).hexdigest() for name in archive.namelist()}
    files = {c["name"]: c["hashes"][0]["content"] for c in inventory["components"] if c["type"] == "file"}
    assert files == expected
    assert {c["name"] for c in inventory["components"] if c["type"] == "library"} == {"rov-fmu", "ziglang"}


def test_a_wheel_is_built_with_what_the_package_needs_in_the_pinned_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.delenv("HATCH_BUILD_NO_HOOKS", raising=False)
    needed = build_backend.get_requires_for_build_wheel()
    pins = [line for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines() if "==" in line]
    assert {*pins, "click>=8.2"} <= {*needed}
    assert not {*pins} & {*build_backend.get_requires_for_build_editable()}
    monkeypatch.setenv("HATCH_BUILD_NO_HOOKS", "true")
    assert not {*pins} & {*build_backend.get_requires_for_build_wheel()}


@pytest.mark.weekly
def test_two_builds_have_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HATCH_BUILD_NO_HOOKS", "true")  # tests/cli/test_wheel.py looks at the FMUs in a wheel
    first, second = tmp_path / "first", tmp_path / "the second"
    for folder in (first, second):
        folder.mkdir()
        release.distributions(folder)
        release.fmus(folder, ["videoray"], "host")
    assert release.differences(first, second) == []
    release.inventories(first)
    for path in first.glob("*.cdx.json"):
        assert valid(path.read_text(encoding="utf-8"))
    (first / "SHA256SUMS").write_text(release.sums(first), encoding="utf-8")
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=first, check=True)
    fmus = sorted(path.name for path in first.glob("*.fmu"))
    assert len(fmus) == 3
    described = sorted(path.name.removesuffix(".cdx.json") for path in first.glob("*.cdx.json"))
    assert described == sorted([*fmus, *(path.name for path in first.glob("*.whl"))])
    twine: list[str | Path] = [
        sys.executable,
        "-m",
        "twine",
        "check",
        "--strict",
        *first.glob("*.whl"),
        *first.glob("*.tar.gz"),
    ]
    subprocess.run(twine, check=True)  # the long description renders


def committed(folder: Path, name: str, text: str, day: str) -> None:
    """Write a file of a checkout, and commit it on a day."""
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    now = {"GIT_AUTHOR_DATE": f"{day}T12:00:00Z", "GIT_COMMITTER_DATE": f"{day}T12:00:00Z"}
    who = {f"GIT_{role}_{key}": "someone" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")}
    for words in (["add", "."], ["commit", "-qm", name]):
        subprocess.run(["git", *words], cwd=folder, check=True, env={**os.environ, **now, **who})


def test_a_release_has_the_notes_of_its_own_code(tmp_path: Path) -> None:
    """The first heading decides, and code that changed after its date would be released with the notes of before."""
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    committed(tmp_path, "rov_fmu/code.py", "first", "2030-01-01")
    committed(tmp_path, "CHANGELOG.md", "## [0.3.0] – 2030-01-01\n\n## [0.2.0] – 2029-01-01\n", "2030-01-02")
    committed(tmp_path, "CITATION.cff", 'a: b\nversion: 0.3.0\ndate-released: "2030-01-01"\n', "2030-01-02")
    assert release.wrong_headings("0.3.0", tmp_path) == []
    (line,) = release.wrong_headings("0.2.0", tmp_path)
    assert line.startswith("CHANGELOG.md: the first heading is '[0.3.0] – 2030-01-01', and must be '[0.2.0] – '")
    (line,) = release.wrong_headings("0.3.0.dev0", tmp_path)
    assert "0.3.0.dev0 is in development" in line
    committed(tmp_path, "rov_fmu/code.py", "second", "2030-01-03")
    (line,) = release.wrong_headings("0.3.0", tmp_path)
    assert "'[0.3.0] – 2030-01-01' is older than the code, which changed last by: 2030-01-03" in line
    committed(tmp_path, "CHANGELOG.md", "# Changelog\n\n## [0.3.0] – 2030-01-03\n", "2030-01-03")
    assert release.wrong_headings("0.3.0", tmp_path) == [
        "CITATION.cff: must have a line 'date-released: \"2030-01-03\"'"
    ]
