"""From a vehicle to its FMU: page and content made, compiled, written, validated and run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from rov_fmu.engine.compile import OTHER_NAMES, PLATFORMS, BuildError, OptionError, compile_all, host_platform
from rov_fmu.fmu.archive import archive, native_content, python_content
from rov_fmu.fmu.model_description import NATIVE
from rov_fmu.fmu.module import module
from rov_fmu.fmu.osp import osp_model_description, osp_path
from rov_fmu.fmu.reference_results import reference_results
from rov_fmu.io.file_kinds import FMU, check_written
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import InputError, did_you_mean, shown
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.report.page.fmu_page import documentation
from rov_fmu.vehicle.vehicle import Vehicle, check_coefficients

BACKENDS = ("native", "pythonfmu")


@dataclass(frozen=True)
class Built:
    """What a build made."""

    path: Path
    size: int
    """Of the archive in bytes."""
    guid: str
    binaries: Mapping[str, int]
    """Size in bytes by platform; none in the flavour in pure Python."""
    seconds: Mapping[str, float]
    """Until each platform was compiled."""
    note: str
    """What was found when the FMU was validated and run."""
    beside: Sequence[Path]
    """What was written beside it."""


def build(
    vehicle: Vehicle,
    output: str | Path | None = None,
    *,
    platforms: str | Sequence[str] | None = None,
    backend: str = "native",
    fmi: int = 2,
    osp: bool = False,
    inputs: Sequence[Path] = (),
    on_compiled: Callable[[str], None] = lambda _: None,
) -> Built:
    """Build the FMU of a vehicle, validate it and run it; it is written whole or not at all.

    `output` is the file to write: by default <identifier>.fmu in this folder, for FMI 3.0 <identifier>.fmi3.fmu.
    `platforms` names one or several of PLATFORMS, or `host`, which is this machine; all by default. `backend` is
    `native`, or `pythonfmu` for the flavour in pure Python, which is the same for all platforms. `fmi` is the version
    of FMI, 2 or 3. `osp` also writes <identifier>_OspModelDescription.xml beside the FMU. `pythonfmu` and `osp` need
    FMI 2.0. `inputs` are files that must not be overwritten, besides those that the vehicle names. `on_compiled` is
    called with the name of each platform when it is done.

    Raises InputError where `vehicle` is not a vehicle, or has coefficients that it cannot have; OptionError about the
    other arguments; BuildError where the build fails; VehicleFileError where a file of the vehicle cannot be read;
    WriteError, an OSError, about a path that cannot be written.
    """
    if not isinstance(vehicle, Vehicle):
        raise InputError(f"vehicle = {shown(vehicle)}: must be a vehicle, as rov_fmu.load({str(vehicle)!r}) returns it")
    check_coefficients(vehicle.layout, vehicle.rov.coefficients)
    if backend not in BACKENDS:
        raise OptionError(f"there is no backend {shown(backend)}, only {', '.join(BACKENDS)}")
    native = backend == "native"
    if fmi not in NATIVE:
        raise OptionError(f"there is no FMI version {fmi!r}, only {', '.join(map(str, NATIVE))}")
    if fmi == 3 and not native:
        raise OptionError("--fmi 3: PythonFMU makes FMI 2.0 alone")
    if fmi == 3 and osp:
        raise OptionError("--fmi 3: libcosim and the OSP tools, which --osp is for, read FMI 2.0 alone")
    output = Path(output or f"{vehicle.identifier}{'' if native else '-python'}{'.fmi3' if fmi == 3 else ''}.fmu")
    beside = []
    if osp:
        description = osp_model_description(vehicle.layout)
        beside = [Output(osp_path(output, vehicle.identifier), description)]
    check_targets([output, *(other.path for other in beside)], [*inputs, *vehicle.files])
    check_written(output, FMU)
    chosen = chosen_platforms(platforms, fmi) if native else []
    results = reference_results(vehicle)
    flown = module(vehicle.rov)
    pages = {**documentation(vehicle, native=native, fmi=fmi, module=flown), **results}
    content = native_content(vehicle, pages, fmi) if native else python_content(vehicle, pages)
    start = perf_counter()
    seconds: dict[str, float] = {}

    def done(name: str) -> None:
        seconds[name] = perf_counter() - start
        on_compiled(name)

    binaries = compile_all(chosen, content.sources, content.identifier, done, fmi)
    libraries = {
        f"binaries/{_folder(name, fmi)}/{content.identifier}{PLATFORMS[name].suffix}": library
        for name, library in binaries.items()
    }
    packed = archive({**content.files, **libraries})
    notes: list[str] = []
    draft = Output(output, packed, lambda path: notes.append(_check(path, vehicle, chosen if native else None, fmi)))
    write_whole(draft, *beside)
    sizes = {name: len(library) for name, library in binaries.items()}
    written = [other.path for other in beside]
    return Built(output, len(packed), content.guid, sizes, seconds, notes[0], written)


def chosen_platforms(names: str | Sequence[str] | None, fmi: int = 2) -> list[str]:
    """Platforms by name, `host` resolved for this version of FMI; all where none is named. Raises BuildError."""
    if not names:
        return list(PLATFORMS)
    names = [names] if isinstance(names, str) else names
    if unknown := set(names) - {"host", *PLATFORMS}:
        hint = did_you_mean(min(unknown), ["host", *PLATFORMS], also=OTHER_NAMES)
        names_of_all = ", ".join(["host", *PLATFORMS])
        raise BuildError(f"there is no platform {', '.join(sorted(unknown))}, only {names_of_all}{hint}")
    host = host_platform(fmi)
    if "host" in names and host is None:
        raise BuildError(f"--platform host: there is no platform for this machine, only {', '.join(PLATFORMS)}")
    return list(dict.fromkeys(host if name == "host" and host else name for name in names))


def _folder(name: str, fmi: int) -> str:
    """Of binaries/."""
    return name if fmi == 2 else PLATFORMS[name].folder


def _check(path: Path, vehicle: Vehicle, platforms: Sequence[str] | None, fmi: int) -> str:
    """Validate and run an FMU; what to tell. Raises BuildError."""
    import fmpy
    from fmpy.validation import validate_fmu

    if problems := validate_fmu(str(path)):
        raise BuildError(f"the FMU is not valid: {problems[0]}")
    loaded = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    # FMPy runs nothing without a binary for a platform that it knows, even where it loads another one
    known = fmpy.platform in fmpy.supported_platforms(str(path))
    if platforms is not None and not (known and loaded in [_folder(name, fmi) for name in platforms]):
        return "valid; not run, for it has no binary that FMPy loads on this machine"
    with temporary_folder("fmu-") as folder:
        fmpy.extract(str(path), unzipdir=folder)
        axis = vehicle.layout.axes[0].axis
        start = {name: 0.3 * sign for name, sign in vehicle.layout.signs(axis).items()}
        result = fmpy.simulate_fmu(folder, start_values=start)
    by_value = {value: " = ".join(name for name in start if start[name] == value) for value in start.values()}
    commands = ", ".join(f"{names} = {value:g}" for value, names in by_value.items())
    end = f"{axis.velocity} = {result[axis.velocity][-1]:.4f} {axis.unit} after {result['time'][-1]:g} s"
    return f"valid; runs: {commands} gives {end}"
