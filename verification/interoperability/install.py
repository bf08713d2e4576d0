"""Install the importers: those in Python into virtual environments, those in Java and Rust into folders."""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from .importers import HERE, IMPORTERS, Importer, environment
from .run import without_places

# The programs that each kit needs from the system, and the Debian packages that contain them.
PROGRAMS: dict[str, tuple[tuple[str, ...], str]] = {
    "python": ((), "python3-venv"),
    "java": (("java", "javac", "mvn"), "openjdk-17-jdk-headless maven"),
    "rust": (("cargo",), "cargo libclang-dev; fmi-rs takes Rust 1.88"),
}
MAVEN = "org.apache.maven.plugins:maven-dependency-plugin:3.8.1"
ATTEMPTS = 3


class InstallError(Exception):
    """A kit that cannot be installed, with the output of the failed tool."""


def install(kit: str, tools: Path, say: Callable[[str], None]) -> None:
    """Install the missing importers of a kit. Raises InstallError."""
    programs, packages = PROGRAMS[kit]
    try:
        _install(kit, programs, tools, say)
    except InstallError as error:
        raise InstallError(f"{kit}: {error}\nDebian has what it takes: apt-get install {packages}") from error


def _install(kit: str, programs: tuple[str, ...], tools: Path, say: Callable[[str], None]) -> None:
    if missing := [name for name in programs if shutil.which(name) is None]:
        raise InstallError(f"there is no {missing[0]}")
    wanted = {(i.pin_file, i.package): i for i in IMPORTERS if i.kit == kit and not i.is_installed(tools)}
    if not wanted:
        say(f"{kit}: all is there")
    elif kit == "python":
        for requirements in dict.fromkeys(file for file, _ in wanted):
            say(f"{kit}: {requirements}")
            _install_python(requirements, tools)
    else:
        for importer in wanted.values():
            say(f"{kit}: {importer.title} {importer.version}")
            (_install_java if kit == "java" else _install_rust)(importer, tools)
    if absent := [i.title for i in wanted.values() if not i.is_installed(tools)]:
        raise InstallError(f"{absent[0]} was installed, but is not where it is looked for")


def _install_python(requirements: str, tools: Path) -> None:
    place = tools / environment(requirements)
    _call([sys.executable, "-m", "venv", "--clear", "--without-pip", str(place)], tools)
    # Most of the modules are never imported, so they are not compiled here.
    options = ["--python", str(place), "--quiet", "--disable-pip-version-check", "install", "--no-compile"]
    _call([sys.executable, "-m", "pip", *options, "-r", str(HERE / requirements)], tools)


def _install_java(importer: Importer, tools: Path) -> None:
    goal = "unpack-dependencies" if importer.program == "vdmcheck" else "copy-dependencies"
    project, folder = HERE / importer.pin_file, tools / "java" / importer.program
    places = [f"-DoutputDirectory={folder}", f"-DmarkersDirectory={folder}"]
    _call(["mvn", "-q", "-B", "-f", str(project), f"{MAVEN}:{goal}", *places], tools)


def _install_rust(importer: Importer, tools: Path) -> None:
    package = importer.package
    folder = tools / "rust" / f"{package}-{importer.version}"
    # Without optimization, because it would take longer than it saves.
    options = ["--quiet", "--config", "profile.dev.debug=false"]
    if package == "fmi-sim":  # the crate's lock file pins all its dependencies
        program = f"{package}@{importer.version}"
        _call(["cargo", "install", *options, "--debug", "--locked", program, "--root", str(folder)], tools)
        return
    with tempfile.TemporaryDirectory() as name:  # Cargo.lock names the registry, so it must not be in the sources
        project = shutil.copytree((HERE / importer.pin_file).parent, Path(name) / "fly") / "Cargo.toml"
        _call(["cargo", "build", *options, "--manifest-path", str(project), "--target-dir", str(folder)], tools)


def _call(command: list[str], tools: Path) -> None:
    for attempt in range(1, ATTEMPTS + 1):
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        if done.returncode == 0:
            return
        if attempt < ATTEMPTS:  # registries fail now and then
            time.sleep(5.0 * attempt)
    output = without_places(done.stdout.decode(errors="replace"), Path(tempfile.gettempdir()), tools)
    raise InstallError("\n".join([f"{Path(command[0]).name} failed", *output.strip().splitlines()[-15:]]))
