"""Build an FMI 2.0 FMU of an identified ROV from its vehicle file."""

import argparse
import asyncio
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from fmu_src.compile import PLATFORMS, BuildError, compile_all, host_platform
from fmu_src.interface import variables
from fmu_src.osp import osp_model_description, osp_path
from models.command_line import exit_code, run_process
from models.files import Output, check_targets, write_whole
from models.messages import FileError
from models.vehicle import VIDEORAY, Vehicle, load_vehicle

if TYPE_CHECKING:
    from fmu_src.package import Content


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 built, 1 the build failed, 2 bad input, 130 interrupted."""
    return exit_code("build_fmu", lambda: _run(arguments), {FileError: 2, BuildError: 1, OSError: 1})


def _run(arguments: Sequence[str] | None) -> None:
    options = _parser().parse_args(arguments)
    vehicle = load_vehicle(options.vehicle)
    python = options.backend == "pythonfmu"
    if python and options.platform:
        raise BuildError("--platform: the PythonFMU flavour is the same for all platforms")
    output: Path = options.output or Path(f"{vehicle.identifier}{'-python' if python else ''}.fmu")
    beside = []
    if options.osp:
        description = osp_model_description(variables(vehicle.coefficients))
        beside = [Output(osp_path(output, vehicle.identifier), description)]
    check_targets([output, *(other.path for other in beside)], [options.vehicle, *vehicle.files])
    build(vehicle, output, None if python else _chosen_platforms(options.platform), beside=beside)


def build(
    vehicle: Vehicle,
    output: Path,
    platforms: Sequence[str] | None,
    console: Console | None = None,
    beside: Sequence[Output] = (),
) -> None:
    """Compile, write, validate and run the FMU of a vehicle, and print what was built. Raises BuildError.

    Platforms None is the flavour in pure Python. What is to stand beside the FMU is written with it or not at all.
    """
    from fmu_src.package import archive, native_content, python_content

    started = time.perf_counter()
    console = console or Console()
    content = python_content(vehicle) if platforms is None else native_content(vehicle)
    binaries, seconds = _compile(content, platforms or [], console)
    notes: list[str] = []
    files = {_binary(name, content.identifier): library for name, library in binaries.items()}
    packed = archive({**content.files, **files})
    write_whole(Output(output, packed, lambda draft: notes.append(_check_fmu(draft, platforms))), *beside)
    console.print(
        Text.assemble((str(output), "bold"), f"  {len(packed) / 1000:.0f} kB  {content.guid}"), soft_wrap=True
    )
    for name in platforms or []:
        size = len(binaries[name]) / 1000
        console.print(f"  {name:<14}{size:6.0f} kB{seconds[name]:7.1f} s", highlight=False)
    for note in notes:
        console.print(f"  {note}", highlight=False)
    for other in beside:
        console.print(Text(str(other.path), "bold"), soft_wrap=True)
    console.print(f"  built in {time.perf_counter() - started:.1f} s", highlight=False)


def _compile(
    content: "Content", platforms: Sequence[str], console: Console
) -> tuple[dict[str, bytes], dict[str, float]]:
    """The binaries by platform, compiled side by side, and after how many seconds each was there."""
    start = time.perf_counter()
    seconds: dict[str, float] = {}
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        tasks = {name: progress.add_task(f"compiling {name}", total=1) for name in platforms}

        def done(name: str) -> None:
            seconds[name] = time.perf_counter() - start
            progress.update(tasks[name], completed=1)

        return asyncio.run(compile_all(platforms, content.sources, content.identifier, done)), seconds


def _binary(name: str, identifier: str) -> str:
    return f"binaries/{name}/{identifier}{PLATFORMS[name].suffix}"


def _check_fmu(path: Path, platforms: Sequence[str] | None) -> str:
    """Validate and run an FMU; what to tell. Raises BuildError."""
    import fmpy
    from fmpy.validation import validate_fmu

    if problems := validate_fmu(str(path)):
        raise BuildError(f"the FMU is not valid: {problems[0]}")
    host = host_platform()
    if platforms is not None and (host not in platforms or host != fmpy.platform):
        return "valid; not run, for it has no binary that FMPy loads on this machine"
    with tempfile.TemporaryDirectory(prefix="fmu-", ignore_cleanup_errors=True) as folder:
        fmpy.extract(str(path), unzipdir=folder)
        result = fmpy.simulate_fmu(folder, start_values={"u_l": 0.3, "u_r": 0.3})
    return f"valid; runs: u_l = u_r = 0.3 gives u = {result['u'][-1]:.4f} m/s after {result['time'][-1]:g} s"


def _chosen_platforms(names: Sequence[str] | None) -> list[str]:
    if not names:
        return list(PLATFORMS)
    host = host_platform()
    if "host" in names and host is None:
        raise BuildError(f"--platform host: there is no platform for this machine, only {', '.join(PLATFORMS)}")
    return list(dict.fromkeys(host if name == "host" and host else name for name in names))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="build_fmu.py", description=__doc__)
    parser.add_argument("vehicle", nargs="?", type=Path, default=VIDEORAY, metavar="VEHICLE.toml",
                        help="vehicle file (default: the VideoRay Pro 4)")  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.fmu",
                        help="where to write it (default: <identifier>.fmu in this folder)")  # fmt: skip
    parser.add_argument("--backend", choices=["native", "pythonfmu"], default="native",
                        help="compiled C (default), or pure Python with PythonFMU")  # fmt: skip
    parser.add_argument("--platform", action="append", choices=["host", *PLATFORMS], metavar="NAME",
                        help=f"host, {', '.join(PLATFORMS)}; may be repeated (default: all)")  # fmt: skip
    parser.add_argument("--osp", action="store_true",
                        help="also write <identifier>_OspModelDescription.xml beside it (OSP-IS 1.0.1)")  # fmt: skip
    return parser


if __name__ == "__main__":
    run_process(main)
