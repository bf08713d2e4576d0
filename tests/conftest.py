"""The FMUs under test, built for this machine once in a run, by the command line of the exporter."""

import atexit
import gc
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import chain, islice
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any

import fmpy
import pytest
from filelock import FileLock
from fmpy.fmi2 import defaultCallbacks, fmi2CallbackLoggerTYPE, printLogMessage
from hypothesis import settings

from rov_fmu.c import compile as compilation
from rov_fmu.c.compile import ENGINE_FILE, LANES_FILE, compile_all, host_platform
from rov_fmu.c.library import engine_sources
from rov_fmu.c.simulation import usable_cores
from rov_fmu.cli import main
from rov_fmu.equation.layout import Layout
from rov_fmu.io import interrupts
from rov_fmu.tank.readers.parsers import one_parser
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import ROOT
from tests.equation.steps import Step, in_fmu
from tests.fmi2 import Fmu
from tests.vehicles import (
    EVERYTHING,
    HEAVY,
    OUTSIDE,
    SIX,
    THRUST_EFFECTS,
    a_vehicle,
    in_waves,
    passed,
    surfaced,
    with_rotors,
)

# Containers often forbid bytecode. Each worker then rewrites all tests, and each command compiles its modules, anew.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

VIDEORAY_LAYOUT = load_vehicle(VIDEORAY).layout
_BEFORE = pytest.StashKey[set[Path]]()
_NOT_LOOKED_AT = {
    ".git",
    ".venv",
    ".hypothesis",
    "node_modules",
    ".tools",
    ".cache",
    ".config",
    ".npm",
    ".m2",
    ".java",
    ".cargo",
}
"""What is no test's: other programs write it, such as the importers that .ci/run installs meanwhile."""
compile_anew = compilation._Library.compile
"""The method that compiles a library even if another test has done so."""
_LOGGER = fmi2CallbackLoggerTYPE(printLogMessage)
defaultCallbacks.logger = _LOGGER
"""The logger of instances without one. FMPy 0.3 forwards messages to the logger that it was given last in the process,
even after that logger is gone, and would then crash."""


def pytest_xdist_auto_num_workers() -> int:
    """Return one worker for each core. One more would cost its collection, and save nothing."""
    return usable_cores()


def pytest_configure(config: pytest.Config) -> None:
    """Let Hypothesis try fresh examples in the weekly tests, and the same few ones in every run of the other tests.

    A change can then only fail for a reason of its own.
    """
    settings.register_profile("same", derandomize=True, database=None, deadline=None, max_examples=40)
    settings.register_profile("fresh", derandomize=False, database=None, deadline=None, print_blob=True)
    settings.load_profile("fresh" if config.option.markexpr == "weekly" else "same")
    if not hasattr(config, "workerinput"):
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", gettempdir())  # where those of tmp_path stay
        os.environ["TMPDIR"] = tempfile.tempdir = mkdtemp(prefix="rov-fmu-tests-")
        atexit.register(shutil.rmtree, gettempdir(), ignore_errors=True)
        config.stash[_BEFORE] = {*_places()}


def _places() -> Iterator[Path]:
    """Yield what is in the temporary folder of this run, in the home if there is one, and in the checkout."""
    home = os.environ.get("HOME") or os.environ.get("USERPROFILE", "")
    for folder, names, files in chain(islice(os.walk(gettempdir()), 1), islice(os.walk(home), 1), os.walk(ROOT)):
        names[:] = [name for name in names if not name.endswith(("cache", "cache__")) and name not in _NOT_LOOKED_AT]
        yield from (Path(folder, name) for name in (*names, *files))


@pytest.hookimpl(wrapper=True)
def pytest_sessionfinish(session: pytest.Session) -> Iterator[None]:
    """Say what the tests leave behind, when all workers have ended, and what they remove then is gone.

    The run of the default tests fails by it: beside CI, by what is in the temporary folder, because others may write
    into the home and the checkout meanwhile. With other tests, the site is built beside them, and importers and
    browsers leave what is theirs.
    """
    yield
    if hasattr(session.config, "workerinput"):
        return
    removed_later = {action.args[0] for action, _ in interrupts._PENDING if isinstance(action, partial)}
    left = [path for path in _places() if path not in session.config.stash[_BEFORE] and str(path) not in removed_later]
    if left:
        print(f"\nThe tests left behind: {', '.join(map(str, left))}", file=sys.stderr)
        is_default = session.config.option.markexpr.startswith("not long")
        if is_default and ("CI" in os.environ or any(path.is_relative_to(gettempdir()) for path in left)):
            session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Keep the garbage collector from the collected tests. It would look through all of them again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_unconfigure() -> None:
    """Give the collected tests back to the garbage collector. Some bindings complain at the end of what is left."""
    gc.unfreeze()


def pytest_itemcollected(item: pytest.Item) -> None:
    """Remove the marker `long` from a weekly test, which it may have from another of its parameters."""
    if item.get_closest_marker("weekly"):
        item.own_markers = [mark for mark in item.own_markers if mark.name != "long"]


@pytest.fixture(autouse=True, scope="session")
def one_process() -> Iterator[None]:
    """Read the logs of all tests in one child process, which takes half a second to start."""
    with one_parser():
        yield


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load_vehicle(VIDEORAY)


@pytest.fixture(scope="session")
def heavy() -> Vehicle:
    """Return the BlueROV2 Heavy without roll and pitch."""
    return HEAVY


Made = Callable[[str, Callable[[Path], object]], Path]
"""A function that returns the folder with a name, and calls another function to fill it if it is new."""


@pytest.fixture(scope="session")
def made_once(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Make a folder once in a run, by the worker that needs it first. Tests only read it."""
    base = tmp_path_factory.getbasetemp()
    if hasattr(pytestconfig, "workerinput"):  # all workers of a run share the parent folder
        base = base.parent
    shared = base / "made once"  # a name that mktemp() does not use
    shared.mkdir(exist_ok=True)

    def made(name: str, fill: Callable[[Path], object]) -> Path:
        folder, draft = shared / name, tmp_path_factory.mktemp("draft")
        with FileLock(shared / f"{name}.lock"):
            if not folder.exists():
                fill(draft)
                draft.rename(folder)
        return folder

    return made


@pytest.fixture(scope="session", autouse=True)
def _compiled_once(made_once: Made) -> Iterator[None]:
    """Let the builds of all workers compile the same C with the same compiler and flags once in a run."""

    def compiled(library: compilation._Library, compilers: compilation._Compilers) -> bytes:
        key = hashlib.sha256(repr((library, compilation.compiler())).encode()).hexdigest()
        folder = made_once(f"C {key}", lambda of: (of / "library").write_bytes(compile_anew(library, compilers)))
        return (folder / "library").read_bytes()

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(compilation._Library, "compile", compiled)
        yield


def _videoray(folder: Path, fmi: int) -> None:
    """Build the VideoRay's FMU into a folder, and unzip it there."""
    path = folder / f"videoray{'.fmi3' if fmi == 3 else ''}.fmu"
    assert main(["build", "--fmi", str(fmi), "--platform", "host", "-o", str(path)]) == 0
    fmpy.extract(str(path), unzipdir=str(path.with_suffix("")))


@pytest.fixture(scope="session")
def videoray_fmu(made_once: Made) -> Path:
    # a path with a space and an umlaut, as users have them
    return made_once("FMU für Tests", lambda folder: _videoray(folder, 2)) / "videoray.fmu"


@pytest.fixture(scope="session")
def videoray_dir(videoray_fmu: Path) -> Path:
    return videoray_fmu.with_suffix("")


@pytest.fixture(scope="session")
def videoray3_fmu(made_once: Made) -> Path:
    return made_once("FMU für FMI 3", lambda folder: _videoray(folder, 3)) / "videoray.fmi3.fmu"


@pytest.fixture(scope="session")
def videoray3_dir(videoray3_fmu: Path) -> Path:
    return videoray3_fmu.with_suffix("")


def out_of_line(sources: Mapping[str, str]) -> dict[str, str]:
    """Return C files without the inlining that takes most of the compiler's time. They compute the same bits."""
    return {name: text.replace("always_inline", "noinline") for name, text in sources.items()}


@pytest.fixture(scope="session", autouse=True)
def _engines_quickly() -> Iterator[None]:
    """Compile the engines of all vehicles but the VideoRay's out of line. Filters have nothing that is inlined."""

    def quick(layout: Layout, file: Path = ENGINE_FILE) -> dict[str, str]:
        sources = engine_sources(layout, file)
        return out_of_line(sources) if file in (ENGINE_FILE, LANES_FILE) and layout != VIDEORAY_LAYOUT else sources

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.c.library.engine_sources", quick)
        yield


@contextmanager
def without_page() -> Iterator[None]:
    """Let builds in this process leave out the FMU's page, which takes most of their time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.build.web_module", lambda _: b"")
        patched.setattr("rov_fmu.build.documentation", lambda *_, **__: {})
        yield


def unzipped(vehicle: Vehicle, folder: Path, fmi: int = 2) -> Path:
    """Write the unzipped FMU of a vehicle, without its page, to a folder, and return the folder.

    It is compiled out of line. The VideoRay's is built as it ships.
    """
    from rov_fmu.fmu.content import native_content

    interface = "cs" if vehicle.layout.current_passes else "both"
    platform, content = host_platform(fmi), native_content(vehicle, fmi=fmi, interface=interface)
    assert platform
    (library,) = compile_all([platform], out_of_line(content.sources), content.identifier, fmi=fmi).values()
    host = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    binary = f"binaries/{host}/{content.identifier}{fmpy.sharedLibraryExtension}"
    for name, data in {**content.files, binary: library}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def _folder_of(name: str, vehicle: Callable[[], Vehicle], fmi: int) -> Any:
    """Return a fixture: the folder with the unzipped FMU of a vehicle."""

    @pytest.fixture(scope="session")
    def folder(made_once: Made) -> Path:
        return made_once(name, lambda folder: unzipped(vehicle(), folder, fmi))

    return folder


heavy_dir, heavy3_dir = (_folder_of(f"heavy{fmi}", lambda: HEAVY, fmi) for fmi in (2, 3))
everything_dir, everything3_dir = (
    _folder_of(f"everything{fmi}", lambda: load_vehicle(EVERYTHING), fmi) for fmi in (2, 3)
)
thrust_dir, thrust3_dir = (_folder_of(f"thrust{fmi}", lambda: load_vehicle(THRUST_EFFECTS), fmi) for fmi in (2, 3))
rotors_dir, rotors3_dir = (_folder_of(f"rotors{fmi}", lambda: a_vehicle(with_rotors(SIX)), fmi) for fmi in (2, 3))
passed_dir, passed3_dir = (_folder_of(f"passed{fmi}", lambda: a_vehicle(passed(HEAVY)), fmi) for fmi in (2, 3))
wavy_dir, wavy3_dir = (_folder_of(f"wavy{fmi}", lambda: a_vehicle(in_waves(surfaced(SIX))), fmi) for fmi in (2, 3))
six_dir, outside3_dir = _folder_of("six", lambda: a_vehicle(SIX), 2), _folder_of("outside", lambda: OUTSIDE, 3)


@pytest.fixture(scope="module")
def fmu(videoray_dir: Path) -> Fmu:
    """Return the VideoRay's FMU, with its shared library loaded for one file of tests."""
    return Fmu(videoray_dir)


@pytest.fixture
def steps(fmu: Fmu) -> list[Step]:
    """The step of the VideoRay in C."""
    return [partial(in_fmu, fmu)]
