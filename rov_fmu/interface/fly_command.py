"""Write the page on which a vehicle flies in a browser, for `rov-fmu fly`, and open it."""

import webbrowser
from collections.abc import Sequence
from pathlib import Path
from tempfile import mkdtemp

from rov_fmu.fmu.content import web_module
from rov_fmu.io.file_kinds import PAGE
from rov_fmu.io.messages import print_message
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import console
from rov_fmu.report.page.live import FlyingVehicle, fly_page
from rov_fmu.report.page.recording import recording_of
from rov_fmu.vehicle.steady import beyond_stated
from rov_fmu.vehicle.vehicle import load_vehicle


def write_fly_page(
    paths: Sequence[Path], recording: Path | None, output: Path | None, *, force: bool
) -> dict[Path, str]:
    """Write the page of one vehicle file, or of two, of which the second is the ghost.

    Return its path, with what it replaced.

    `recording` is a log that is flown beside the measurements. Without `output` the page goes into a new temporary
    folder. Raises FileError and OSError.
    """
    vehicles = [load_vehicle(path) for path in paths]
    for words in beyond_stated(vehicles[0]):
        print_message(f"rov-fmu: {words}")
    read = [*paths, *filter(None, [recording]), *(file for vehicle in vehicles for file in vehicle.files)]
    check_targets([(output, PAGE)], read, force=force)
    flown = recording_of(recording, vehicles[0]) if recording else None
    names = [path.name for path in paths]
    names = names if len({*names}) == len(names) else [*map(str, paths)]  # with their folders if the names are the same
    shown = [
        FlyingVehicle(vehicle, web_module(vehicle.layout), name) for vehicle, name in zip(vehicles, names, strict=True)
    ]
    path = output or Path(mkdtemp(prefix="rov-fmu-"), f"{vehicles[0].identifier}.html")
    return write_whole(Output(path, sealed(fly_page(shown, recording=flown), "fly").encode()), force=force)


def open_in_browser(path: Path, option: str) -> None:
    """Print the path of a file, and open it in a browser.

    `option` is the option with which the user can choose the place of the file.
    """
    console().print(str(path), soft_wrap=True)
    if not webbrowser.open(path.as_uri()):
        print_message(
            "rov-fmu: no browser could be opened. Open this file in a browser, here or on another machine. "
            f"It needs no other files. Use {option} to write it to another place"
        )
