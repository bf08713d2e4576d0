"""Build an FMI 2.0 FMU of an identified ROV from its vehicle file."""

import argparse
import asyncio
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from fmu_src.compile import PLATFORMS, BuildError, compile_all, host_platform
from fmu_src.interface import variables
from fmu_src.osp import osp_model_description, osp_path
from models.csvfile import DataFileError
from models.files import write_whole
from models.vehicle import VIDEORAY, Vehicle, VehicleFileError, load_vehicle

if TYPE_CHECKING:
    from fmu_src.package import Content


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 built, 1 the build failed, 2 bad input, 130 interrupted."""
    options = _parser().parse_args(arguments)
    try:
        vehicle = load_vehicle(options.vehicle)
        python = options.backend == "pythonfmu"
        if python and options.platform:
            raise BuildError("--platform: the PythonFMU flavour is the same for all platforms")
        output: Path = options.output or Path(f"{vehicle.identifier}{'-python' if python else ''}.fmu")
        beside = osp_path(output, vehicle.identifier) if options.osp else None
        for path in filter(None, (output, beside)):
            _check_output(path)
        build(vehicle, output, None if python else _chosen_platforms(options.platform))
        if beside:
            write_whole(beside, osp_model_description(variables(vehicle.coefficients)))
            Console().print(f"[bold]{beside}[/]", highlight=False)
    except (VehicleFileError, DataFileError) as error:
        return _say(str(error), 2)
    except BuildError as error:
        return _say(str(error), 1)
    except OSError as error:
        return _say(f"{error.filename or 'a temporary file'}: cannot be written: {error.strerror or error}", 1)
    except KeyboardInterrupt:
        return _say("interrupted, nothing written", 130)
    return 0


def build(vehicle: Vehicle, output: Path, platforms: Sequence[str] | None, console: Console | None = None) -> None:
    """Compile, write, validate and run the FMU of a vehicle, and print what was built. Raises BuildError.

    Platforms None is the flavour in pure Python.
    """
    from fmu_src.package import archive, native_content, python_content

    started = time.perf_counter()
    console = console or Console()
    content = python_content(vehicle) if platforms is None else native_content(vehicle)
    binaries, seconds = _compile(content, platforms or [], console)
    notes: list[str] = []
    files = {_binary(name, content.identifier): library for name, library in binaries.items()}
    write_whole(output, archive({**content.files, **files}), lambda draft: notes.append(_check_fmu(draft, platforms)))
    console.print(f"[bold]{output}[/]  {output.stat().st_size / 1000:.0f} kB  {content.guid}", highlight=False)
    for name in platforms or []:
        size = len(binaries[name]) / 1000
        console.print(f"  {name:<14}{size:6.0f} kB{seconds[name]:7.1f} s", highlight=False)
    for note in notes:
        console.print(f"  {note}", highlight=False)
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


def _check_output(output: Path) -> None:
    """Fail before the long work, not after it."""
    if output.is_dir():
        raise BuildError(f"{output}: is a folder, not a file to write")
    if not output.parent.is_dir():
        raise BuildError(f"{output}: there is no folder {output.parent}")


def _say(message: str, code: int) -> int:
    print(f"build_fmu: {message}", file=sys.stderr)
    return code


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
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ended from outside, it cleans up as at Ctrl-C
    sys.exit(main())
