"""python -m verification.release FOLDER: make everything that a release has, twice, and write what proves it.

The wheel, the source distribution and the FMUs of all vehicles that ship are built in two folders, and the bytes of
both are compared. Beside them stand SHA256SUMS, and for the wheel and for each FMU a list of what is in it or what it
needs, in CycloneDX 1.6 (ECMA-424). These lists contain no time and no random number, so their bytes do not change.

Then the wheel is installed into a fresh environment, and its user's commands are run there. The last lines say what is
left for a person.
"""

import hashlib
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from filecmp import cmpfiles
from importlib import metadata
from pathlib import Path
from time import perf_counter
from uuid import NAMESPACE_URL, uuid5

import click
from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom, BomMetaData
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.dependency import Dependency
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL
from packaging.requirements import Requirement

from rov_fmu import __version__
from rov_fmu.build import build_fmu
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from verification.checkouts import ROOT
from verification.fresh_environment import environment

_TOOLS = {"native": ("rov-fmu", "ziglang"), "pythonfmu": ("rov-fmu", "pythonfmu")}
"""The packages that make an FMU of each kind, parts of which are in its binaries."""
_CODE = ("rov_fmu", "fmu_src", "models", "build_fmu.py", "build_backend.py", "pyproject.toml")
"""What a release is made of, in a checkout."""


def distributions(folder: Path) -> None:
    """Build the wheel and the source distribution of this checkout."""
    for target in ("wheel", "sdist"):
        subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(folder)], cwd=ROOT, check=True
        )


def fmus(folder: Path, vehicles: Iterable[str] = tuple(SHIPPED), platforms: str | None = None) -> None:
    """Build the FMUs of vehicles that ship: FMI 2.0 and 3.0, and the VideoRay's in Python."""
    for name in vehicles:
        vehicle = load_vehicle(SHIPPED[name])
        build_fmu(vehicle, folder / f"{name}.fmu", platforms=platforms)
        build_fmu(vehicle, folder / f"{name}.fmi3.fmu", platforms=platforms, fmi=3)
    if "videoray" in vehicles:
        build_fmu(load_vehicle(SHIPPED["videoray"]), folder / "videoray.python.fmu", backend="pythonfmu")


def differences(first: Path, second: Path) -> list[str]:
    """Return a line about each file of two folders that is in one only, or has other bytes."""
    names = {path.name for folder in (first, second) for path in folder.iterdir()}
    _, other, alone = cmpfiles(first, second, names, shallow=False)
    lines = [f"{name}: the two builds have other bytes" for name in other]
    return sorted([*lines, *(f"{name}: only one of the two builds wrote this file" for name in alone)])


def digest(content: bytes) -> str:
    """Return the SHA-256 of some bytes."""
    return hashlib.sha256(content).hexdigest()


def wheel_inventory(wheel: Path) -> str:
    """Return the inventory of a wheel: the packages that it requires, with the versions that are installed here.

    The requirements of extras are left out.
    """
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        declared = metadata.PathDistribution(zipfile.Path(archive, name.removesuffix("METADATA"))).requires or []
    required = [Requirement(text) for text in declared]
    needed = [one.name for one in required if one.marker is None or one.marker.evaluate({"extra": ""})]
    return _inventory(wheel, [_package(name) for name in sorted(needed, key=str.lower)])


def fmu_inventory(fmu: Path) -> str:
    """Return the inventory of an FMU: each file with its SHA-256, and the packages that made them."""
    with zipfile.ZipFile(fmu) as archive:
        files = {info.filename: archive.read(info) for info in archive.infolist() if not info.is_dir()}
    kind = "pythonfmu" if any(name.endswith("_slave.py") for name in files) else "native"
    parts = [
        Component(name=name, type=ComponentType.FILE, bom_ref=name, hashes=[_sha256(content)])
        for name, content in sorted(files.items())
    ]
    return _inventory(fmu, [*parts, *map(_package, _TOOLS[kind])])


def _package(name: str) -> Component:
    """Return a Python package with the version that is installed."""
    version = metadata.version(name)
    url = PackageURL("pypi", name=name.lower().replace("_", "-"), version=version)
    return Component(name=name, version=version, type=ComponentType.LIBRARY, purl=url, bom_ref=str(url))


def _sha256(content: bytes) -> HashType:
    return HashType(alg=HashAlgorithm.SHA_256, content=digest(content))


def _inventory(path: Path, parts: list[Component]) -> str:
    """Return the inventory of a file in CycloneDX 1.6 (JSON)."""
    content = path.read_bytes()
    whole = Component(
        name=path.name,
        version=__version__,
        type=ComponentType.APPLICATION,
        bom_ref=path.name,
        hashes=[_sha256(content)],
    )
    bom = Bom(
        components=parts,
        serial_number=uuid5(NAMESPACE_URL, digest(content)),
        metadata=BomMetaData(component=whole),
        dependencies=[Dependency(whole.bom_ref, [Dependency(part.bom_ref) for part in parts])],
    )
    bom.metadata.timestamp = None  # type: ignore[assignment]
    return JsonV1Dot6(bom).output_as_string(indent=1) + "\n"


def inventories(folder: Path) -> None:
    """Write the inventory of each wheel and FMU of a folder beside it, as `<name>.cdx.json`."""
    for path in sorted(folder.iterdir()):
        if path.suffix in (".whl", ".fmu"):
            text = wheel_inventory(path) if path.suffix == ".whl" else fmu_inventory(path)
            path.with_name(f"{path.name}.cdx.json").write_text(text, encoding="utf-8")


def sums(folder: Path) -> str:
    """Return the SHA-256 of each file of a folder, in the form that `sha256sum --check` reads."""
    return "".join(f"{digest(path.read_bytes())}  {path.name}\n" for path in sorted(folder.iterdir()))


def obstacles() -> list[str]:
    """Return a line for each reason why this checkout, or this environment, cannot make a release."""
    lines = []
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        name, _, wanted = line.partition("==")
        if wanted and (installed := metadata.version(name)) != wanted:
            lines.append(f"{name} {installed} is installed, and constraints.txt has {wanted}: CONTRIBUTING.md, Release")
    lines += wrong_headings(__version__, ROOT)
    changed = subprocess.run(
        ["git", "status", "--porcelain", "--", *_CODE], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    return [*lines, *(f"{line[3:]}: is not committed" for line in changed.splitlines())]


def wrong_headings(version: str, checkout: Path) -> list[str]:
    """Return a line for each text of a checkout that tells of another version, or of other code than is there.

    The first heading of the changelog decides what a release says. The code must not have changed after its date:
    otherwise it would get the notes of an earlier state.
    """
    if ".dev" in version:
        return [f"rov_fmu/__init__.py: {version} is in development: set the version of the release"]
    heading = newest_heading(checkout)
    if not (dated := re.fullmatch(rf"\[{re.escape(version)}\] – (\d{{4}}-\d\d-\d\d)", heading)):
        return [f"CHANGELOG.md: the first heading is {heading!r}, and must be '[{version}] – ' with a date"]
    day, lines = dated[1], list[str]()
    citation = (checkout / "CITATION.cff").read_text(encoding="utf-8")
    for text in (f"version: {version}", f'date-released: "{day}"'):
        if f"\n{text}\n" not in citation:
            lines.append(f"CITATION.cff: must have a line {text!r}")
    last = subprocess.run(
        ["git", "log", "-1", "--format=%cs %h %s", "--", *_CODE],
        cwd=checkout,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    if last[:10] > day:
        lines.append(f"CHANGELOG.md: {heading!r} is older than the code, which changed last by: {last}")
    return lines


def newest_heading(checkout: Path) -> str:
    """Return the first heading of the changelog: "[0.3.0] – 2026-12-31", or "[Unreleased] – 0.3.0"."""
    text = (checkout / "CHANGELOG.md").read_text(encoding="utf-8")
    return next(line.removeprefix("## ") for line in text.splitlines() if line.startswith("## "))


def other_fmus(wheel: Path, folder: Path) -> list[str]:
    """Return a line for each FMU in a wheel that has other bytes than the file in the folder."""
    with zipfile.ZipFile(wheel) as archive:
        inside = {Path(name).name: archive.read(name) for name in archive.namelist() if name.endswith(".fmu")}
    wrong = [name for name in sorted(inside) if (folder / name).read_bytes() != inside[name]]
    return [f"{wheel.name}: has other bytes of {name}" for name in wrong]


def tried(wheel: Path, scratch: Path) -> dict[str, float]:
    """Install a wheel into a fresh environment, and run its user's commands there; return the seconds of each.

    Raises subprocess.CalledProcessError if one fails.
    """
    folder = scratch / "tests"
    subprocess.run(
        [sys.executable, "-m", "examples.tank_tests", str(folder)], cwd=ROOT, check=True, capture_output=True
    )
    begun = perf_counter()
    made = environment(scratch / "venv", "-c", ROOT / "constraints.txt", wheel.resolve())
    seconds = {f"pip install {wheel.name}": perf_counter() - begun}
    for command in (
        "rov-fmu fly videoray -o fly.html",
        "rov-fmu simulate videoray --set surge=0.3",
        "rov-fmu build videoray",
        "fmpy simulate videoray.fmu --start-values u_l 0.3 u_r 0.3 --output-file result.csv",
        "rov-fmu identify tests -o rov.toml --report rov.html",
        "rov-fmu build rov.toml --platform host",
    ):
        begun = perf_counter()
        made.run(*command.split(), where=scratch)
        seconds[command] = perf_counter() - begun
    return seconds


def steps_left(folder: Path) -> list[str]:
    """Return what a person does after this program."""
    no_address = not metadata.metadata("rov-fmu").get_all("Project-URL")
    first = "Enter the public addresses in [project.urls] of pyproject.toml, and repeat this command"
    return [
        *([first] if no_address else []),
        f"Look at {folder / 'videoray.fmu'} in a tool that you know",
        f"git tag v{__version__} && git push origin v{__version__}",
        "Wait for the workflow release.yml, and compare its SHA256SUMS with this one",
        "Approve its job pypi. Before the first release, register a pending publisher on PyPI (CONTRIBUTING.md)",
        "Send the entry and the folders of `python -m verification.compatibility` (CONTRIBUTING.md, Publish)",
    ]


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
def main(folder: Path) -> None:
    """Build a release twice, and write it with its proofs. The exit code is 1 if the two builds differ."""
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise click.UsageError(f"{folder}: must be empty or new")
    if lines := obstacles():
        raise click.ClickException("\n".join(lines))
    with temporary_folder("release-") as again:
        for target in (folder, Path(again)):
            distributions(target)
            fmus(target)
        (wheel,) = folder.glob("*.whl")
        if lines := [*differences(folder, Path(again)), *other_fmus(wheel, folder)]:
            raise click.ClickException("\n".join(lines))
    inventories(folder)
    (folder / "SHA256SUMS").write_text(sums(folder), encoding="utf-8")
    click.echo(f"{folder}: two builds have the same bytes; {len([*folder.iterdir()])} files")
    with temporary_folder("release-") as scratch:
        for command, seconds in tried(wheel, Path(scratch)).items():
            click.echo(f"{seconds:6.1f} s  {command}")
    click.echo("\nWhat is left for a person:")
    for n, step in enumerate(steps_left(folder), 1):
        click.echo(f"{n}. {step}")


if __name__ == "__main__":
    main()
