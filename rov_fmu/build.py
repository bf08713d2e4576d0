"""Build the FMU of a vehicle: make its content, compile, write, validate and run it."""

import warnings
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from types import MappingProxyType

import numpy as np

from rov_fmu.c.compile import (
    BACKENDS,
    FMI_VERSIONS,
    INTERFACES,
    OTHER_NAMES,
    PLATFORMS,
    BuildError,
    OptionError,
    compile_all,
    compiler,
    host_platform,
    is_zig,
)
from rov_fmu.c.prebuilt import prebuilt_binaries
from rov_fmu.fmu.archive import archive, is_unchanged
from rov_fmu.fmu.content import FmuContent, native_content, python_content, web_module
from rov_fmu.fmu.reference_results import reference_results
from rov_fmu.fmu.variables import FmuModel
from rov_fmu.fmus.fmu import Fmu
from rov_fmu.fmus.instance import RunError
from rov_fmu.io.file_kinds import FMU
from rov_fmu.io.messages import InputError, did_you_mean, shown
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.io.reading import open_file
from rov_fmu.report.page.fmu_page import documentation
from rov_fmu.vehicle.vehicle import Vehicle, check_coefficients

_RUN, _STEPS = 10.0, 100
"""The length of the run of a new FMU, s, and its steps."""


@dataclass(frozen=True)
class Built:
    """The result of a build."""

    path: Path
    size: int
    """The size of the archive in bytes."""
    guid: str
    binaries: Mapping[str, int]
    """The size of each binary in bytes by platform; none in pure Python."""
    seconds: Mapping[str, float]
    """The time until each platform was compiled, from the start of all compilers, which run in parallel; none of a
    binary that the installed wheel contains."""
    note: str
    """The result of validating and running the FMU."""
    was_run: bool
    """True when the FMU was run, and so has a binary for this machine."""
    written: Mapping[Path, str]
    """The files that were written, each with what it replaced in words, or an empty text."""
    lost: Sequence[str] = ()
    """The folders of binaries/ that the replaced FMU had and this one does not have."""


def build_fmu(
    vehicle: Vehicle,
    output: str | Path | None = None,
    *,
    platforms: str | Sequence[str] | None = None,
    backend: str = "native",
    fmi: int = 2,
    interface: str | None = None,
    force: bool = False,
    inputs: Sequence[Path] = (),
    on_content: Callable[[Sequence[str]], None] = lambda _: None,
    on_compiled: Callable[[str], None] = lambda _: None,
) -> Built:
    """Build the FMU of a vehicle, validate it and run it. After a failure no file is written.

    - `vehicle`: the vehicle, as `rov_fmu.load` or `load_vehicle` returns it.
    - `output`: the file to write, by default <identifier>.fmu or <identifier>.fmi3.fmu in the current folder.
    - `platforms`: one or several of PLATFORMS, or `host` for this machine; by default those with 64 bits.
    - `backend`: `native`, or `pythonfmu` for the FMU in pure Python, which is the same for all platforms.
    - `fmi`: the version of FMI, 2 or 3. `pythonfmu` needs 2.
    - `interface`: `cs` for Co-Simulation, `me` for Model Exchange, or `both`, which is the default; the FMU in pure
      Python has only `cs`, and so has that of a vehicle with `current = "passes"`.
    - `force`: True to replace files that this program did not write, or that have changed since.
    - `inputs`: further files that must not be overwritten, like those that the vehicle names.
    - `on_content`: called with the platforms once the content is made and the compilers begin.
    - `on_compiled`: called with the name of each platform that has been compiled.

        rov_fmu.build_fmu(rov_fmu.load("videoray"), "videoray.fmu", platforms="host").path

    Raises InputError if `vehicle` is not a vehicle, if its coefficients are invalid or if the extra is missing;
    OptionError if another argument is invalid; BuildError if the build fails; FileError if a file of the
    vehicle cannot be read, or if `output` does not end with .fmu; WriteError, an OSError, if a path cannot be written.
    """
    _check_options(vehicle, backend, fmi, interface)
    native = backend == "native"
    interface = interface or ("both" if native and not vehicle.layout.before else "cs")
    version = {2: "", 3: ".fmi3"}[fmi]
    output = Path(output or f"{vehicle.identifier}{'' if native else '-python'}{version}.fmu")
    check_targets([(output, FMU)], [*inputs, *vehicle.files], force=force, is_ours=is_unchanged)
    chosen = chosen_platforms(platforms, fmi) if native else None
    content = _content(vehicle, chosen, fmi=fmi, interface=interface)
    binaries = prebuilt_binaries(content.identifier, content.guid, chosen or [])
    if chosen == chosen_platforms(None, fmi) and not binaries and (here := _only_here(fmi)):
        chosen = [here]
        content = _content(vehicle, chosen, fmi=fmi, interface=interface)
    on_content(chosen or [])
    start = perf_counter()
    seconds: dict[str, float] = {}

    def done(name: str) -> None:
        seconds[name] = perf_counter() - start
        on_compiled(name)

    missing = [name for name in chosen or [] if name not in binaries]
    binaries |= compile_all(missing, content.sources, content.identifier, done, fmi)
    files = with_binaries(content, binaries, fmi)
    packed = archive(files)
    lost = sorted(_platforms_in(output) - _folders(files))
    checked: list[tuple[str, bool]] = []
    draft = Output(output, packed, lambda path: checked.append(_check(path, vehicle, chosen, fmi)))
    written = write_whole(draft, force=force, is_ours=is_unchanged)
    sizes = {name: len(library) for name, library in binaries.items()}
    return Built(output, len(packed), content.guid, sizes, seconds, *checked[0], written, lost)


def with_binaries(content: FmuContent, binaries: Mapping[str, bytes], fmi: int) -> dict[str, bytes]:
    """Return the files of an FMU with its binaries by platform."""
    name = content.identifier
    libraries = {
        f"binaries/{_folder(platform, fmi)}/{name}{PLATFORMS[platform].suffix}": library
        for platform, library in binaries.items()
    }
    return {**content.files, **libraries}


def model_fmu(
    model: FmuModel,
    platforms: Sequence[str] | None = None,
    pages: Mapping[str, bytes] = MappingProxyType({}),
    fmi: int = 2,
) -> bytes:
    """Return the FMU of a model for Co-Simulation, with further files by their paths. Raises BuildError.

    - `platforms`: those of PLATFORMS, or `host`; by default those with 64 bits.
    """
    chosen = chosen_platforms(platforms, fmi)
    content = native_content(model, pages, fmi, "cs", chosen)
    return archive(with_binaries(content, compile_all(chosen, content.sources, content.identifier, fmi=fmi), fmi))


def _content(vehicle: Vehicle, platforms: Sequence[str] | None, *, fmi: int, interface: str) -> FmuContent:
    """Return the content of the FMU, with its expected results and its pages; in pure Python without platforms."""
    native = platforms is not None
    results, module = reference_results(vehicle, native=native), _module(vehicle)
    pages = {**documentation(vehicle, native=native, fmi=fmi, interface=interface, module=module), **results}
    if platforms is None:
        return python_content(vehicle, pages)
    return native_content(vehicle, pages, fmi, interface, platforms)


def _module(vehicle: Vehicle) -> bytes | None:
    """Return the module of the page that flies, or None with a warning if the compiler cannot compile it."""
    try:
        return web_module(vehicle.layout)
    except BuildError as error:
        if is_zig(compiler()):
            raise
        warnings.warn(f"{error}. The page in the FMU does not fly", UserWarning, stacklevel=2)
        return None


def _only_here(fmi: int) -> str | None:
    """Return the platform of this machine, with a warning, if the compiler compiles for no other; or else None."""
    host, command = host_platform(fmi), compiler()
    if not host or is_zig(command):
        return None
    words = f"{Path(command[0]).name} compiles only for this machine, {host}: pip install ziglang for others"
    warnings.warn(words, UserWarning, stacklevel=2)
    return host


def _check_options(vehicle: object, backend: str, fmi: int, interface: str | None) -> None:
    """Raise InputError about the vehicle, or OptionError about an option that is invalid, alone or beside others."""
    if not isinstance(vehicle, Vehicle):
        raise InputError(f"vehicle = {shown(vehicle)}: must be a vehicle, as rov_fmu.load({str(vehicle)!r}) returns it")
    check_coefficients(vehicle.layout, vehicle.coefficients)
    if backend not in BACKENDS:
        raise OptionError(f"there is no backend {shown(backend)}, only {', '.join(BACKENDS)}")
    if fmi not in FMI_VERSIONS:
        raise OptionError(f"there is no FMI version {fmi!r}, only {', '.join(map(str, FMI_VERSIONS))}")
    if fmi == 3 and backend != "native":
        raise OptionError("--fmi 3: PythonFMU makes FMI 2.0 alone")
    if interface is not None and interface not in INTERFACES:
        raise OptionError(f"there is no interface {shown(interface)}, only {', '.join(INTERFACES)}")
    if backend != "native" and interface not in (None, "cs"):
        raise OptionError(f"--interface {interface}: PythonFMU makes Co-Simulation (cs) alone")
    if vehicle.layout.before and interface not in (None, "cs"):
        reason = "it changes velocities, which an importer of Model Exchange owns: Co-Simulation (cs)"
        raise OptionError(f'--interface {interface}: current = "passes": {reason} alone')


def chosen_platforms(names: str | Sequence[str] | None, fmi: int = 2) -> list[str]:
    """Return the platforms with these names, with `host` resolved. Without names, return those by default.

    Raises OptionError about an unknown name, and BuildError if there is no platform for this machine.
    """
    if not names:
        return [name for name, platform in PLATFORMS.items() if platform.by_default]
    names = [names] if isinstance(names, str) else names
    if unknown := set(names) - {"host", *PLATFORMS}:
        hint = did_you_mean(min(unknown), ["host", *PLATFORMS], also=OTHER_NAMES)
        all_names = ", ".join(["host", *PLATFORMS])
        raise OptionError(f"there is no platform {', '.join(sorted(unknown))}, only {all_names}{hint}")
    host = host_platform(fmi)
    if "host" in names and host is None:
        raise BuildError(f"--platform host: there is no platform for this machine, only {', '.join(PLATFORMS)}")
    return list(dict.fromkeys(host if name == "host" and host else name for name in names))


def _platforms_in(fmu: Path) -> set[str]:
    """Return the platforms that an FMU has binaries for; none if there is no FMU at the path."""
    try:
        with open_file(fmu) as file, zipfile.ZipFile(file) as old:
            return _folders(old.namelist())
    except Exception:  # zipfile raises many kinds on damaged archives
        return set()


def _folders(names: Iterable[str]) -> set[str]:
    """Return the folders of binaries/ in the names of an FMU's files."""
    return {name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1}


def _folder(name: str, fmi: int) -> str:
    """Return the folder of a platform in binaries/."""
    return name if fmi == 2 else PLATFORMS[name].folder


def _check(path: Path, vehicle: Vehicle, platforms: Sequence[str] | None, fmi: int) -> tuple[str, bool]:
    """Validate and run an FMU. Return a summary of the result, and whether it was run. Raises BuildError."""
    import fmpy
    from fmpy.validation import validate_fmu

    if problems := validate_fmu(str(path)):
        raise BuildError(f"the FMU is not valid: {problems[0]}")
    loaded = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    # FMPy refuses to run an FMU without a binary in a folder that it knows, although it may load another folder
    known = fmpy.platform in fmpy.supported_platforms(str(path))
    if platforms is not None and not (known and loaded in [_folder(name, fmi) for name in platforms]):
        return "The FMU is valid. It was not run, because it has no binary that FMPy loads on this machine.", False
    axis, others, times = vehicle.shown_axis, vehicle.unidentified, np.linspace(0.0, _RUN, _STEPS + 1)
    start = vehicle.layout.example(axis)
    try:
        result = Fmu.open(path, is_ours=True).run(times, {}, [axis.velocity], start)
    except RunError as error:
        raise BuildError(f"the FMU cannot be run: {error}") from error
    by_value = {value: " = ".join(name for name in start if start[name] == value) for value in start.values()}
    commands = ", ".join(f"{names} = {value:g}" for value, names in by_value.items())
    end = f"{axis.velocity} = {result[axis.velocity][-1]:.4f} {axis.unit} after {_RUN:g} s"
    run = "It runs." if axis in others else f"In a run, {commands} gives {end}."
    return " ".join(
        ["The FMU is valid.", run, *(f"{other.name.capitalize()}: not identified." for other in others)]
    ), True
