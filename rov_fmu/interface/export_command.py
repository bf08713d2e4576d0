"""The command `rov-fmu export`: the files of a vehicle for other simulators, thruster managers and ArduSub."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rov_fmu.bridges.allocation import allocation_files
from rov_fmu.bridges.mujoco import mujoco_files
from rov_fmu.bridges.sdf import Model, gazebo_model
from rov_fmu.bridges.urdf import urdf_model
from rov_fmu.fmu.card import card
from rov_fmu.io.file_kinds import GAZEBO_MODEL
from rov_fmu.io.messages import InputError, listed
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import shell_words
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from rich.table import Table

_ENDS = {
    "mujoco": "_mujoco",
    "allocation": "_allocation",
    "ardusub-gains": "_ardusub_gains",
    "autopilot": "_autopilot",
    "gains": "_gains",
    "sdf": ".sdf",
    "urdf": ".urdf",
}
"""The end of the usual name of a folder or a file, after the identifier of the vehicle, by format."""
_TAKEN = {"mujoco", "numpy", *sys.stdlib_module_names}
"""The names of modules that the folder for MuJoCo imports, directly or through others."""
_OF_CARD = ("Where it holds", "How far to trust it", "What it leaves out")


@dataclass(frozen=True)
class Options:
    """The options of the command, some of which belong to one format only."""

    in_world: bool = False
    """True for a world with water around the model for Gazebo."""
    added_mass: str | None = None
    """"plugin" for the added mass in Gazebo's Hydrodynamics plugin, in place of the link."""
    draws: int | None = None
    """The number of sets of coefficients to draw for MuJoCo."""
    seed: int | None = None
    gains: Path | None = None
    """A file with parameters of ArduSub, whose gains are flown in place of the vehicle's own."""
    force: bool = False
    """True to replace files of others, and to draw also where an axis is not fit for use."""


@dataclass(frozen=True)
class Exported:
    """What was written, and what the reader of the console should know."""

    written: Mapping[Path, str]
    """The file or the folder that was written, with what it replaced."""
    heading: str = ""
    """What the notes are about: "What is different in Gazebo"."""
    notes: Sequence[str] = ()
    warnings: tuple[str, ...] = ()
    following: str = ""
    """The next command."""
    table: "Table | None" = None
    """What a flight showed."""


def export(vehicle: Path, to: str, output: Path | None, options: Options) -> Exported:
    """Write a vehicle in a format: mujoco, allocation, autopilot, gains, ardusub-gains, sdf, urdf.

    Raises FileError, InputError about an option or a vehicle that the format cannot have, and WriteError.
    """
    if mistake := next(_misplaced(to, options), None):
        raise InputError(f"--to {to}: leave out {mistake}")
    loaded = load_vehicle(vehicle)
    path, inputs = output or Path(f"{loaded.identifier}{_ENDS[to]}"), [vehicle, *loaded.files]
    inputs += [options.gains] if options.gains else []
    if to in ("sdf", "urdf"):
        return _exported_file(loaded, to, path, inputs, options)
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, and --to {to} writes a folder")
    files, found = _CONTENTS[to](loaded, path, options)
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    path.mkdir(exist_ok=True)
    check_targets([(path / name, "") for name in files], inputs, force=options.force)
    contents = {name: file.encode() if isinstance(file, str) else file for name, file in files.items()}
    written = write_whole(*(Output(path / name, file) for name, file in contents.items()), force=options.force)
    return replace(found, written={path: listed(dict.fromkeys(filter(None, written.values())))})


def _misplaced(to: str, options: Options) -> Iterator[str]:
    """Yield the options that a format does not have, each with the reason."""
    if to != "sdf" and options.in_world:
        yield "--world, because only a model for Gazebo (sdf) has one"
    if to != "sdf" and options.added_mass:
        yield "--added-mass, because only a model for Gazebo (sdf) has this choice"
    if to != "mujoco" and options.draws:
        yield "--draws, because only mujoco has a table of draws"
    if to != "ardusub-gains" and options.gains:
        yield "--gains, because only ardusub-gains flies them"
    if options.seed is not None and options.draws is None:
        yield "--seed, or give --draws as well"


Contents = tuple[Mapping[str, str | bytes], Exported]
"""The files of a folder by name, and what is printed."""


def _mujoco(vehicle: Vehicle, path: Path, options: Options) -> Contents:
    if not path.name.isidentifier() or iskeyword(path.name) or path.name in _TAKEN:
        reason = "begin with a letter, have only letters, digits and _, and not be that of another module"
        raise InputError(f"{path}: programs import this folder, so its name must {reason}")
    drawn = {}
    if options.draws is not None:
        drawn = vehicle.draws(options.draws, np.random.default_rng(options.seed or 0), forced=options.force)
    paragraphs = card(vehicle)
    columns = {name: column.tolist() for name, column in drawn.items()}
    files = mujoco_files(vehicle, path.name, {heading: paragraphs[heading] for heading in _OF_CARD}, columns)
    there = f"{shell_words('cd', path.parent)} && " if path.parent != Path() else ""
    return files, Exported({}, following=f"{there}python -m {path.name}")


def _ardusub_gains(vehicle: Vehicle, path: Path, options: Options) -> Contents:
    from rov_fmu.bridges.ardusub.files import gains_files, table_of  # Matplotlib: few need it
    from rov_fmu.bridges.ardusub.gains import tuned

    found = tuned(vehicle, options.gains)
    following = f"fly {path / 'gains-from-4.7.param'} (or before-4.7) by rov-fmu sitl, and then in the pool"
    return gains_files(found), Exported({}, "Note", found.notes, following=following, table=table_of(found))


def _autopilot(vehicle: Vehicle, path: Path, _: Options) -> Contents:
    from rov_fmu.bridges.autopilot.files import autopilot_files

    named = path / f"{vehicle.identifier}_autopilot.fmu"
    following = f"connect {named} with the FMU of the vehicle: pose, velocities and thrusters (docs/system.md)"
    return autopilot_files(vehicle), Exported({}, following=following)


def _gains(vehicle: Vehicle, *_: object) -> Contents:
    from rov_fmu.bridges.autopilot.files import gains_yaml

    return gains_yaml(vehicle), Exported({})


_CONTENTS: Mapping[str, Callable[[Vehicle, Path, Options], Contents]] = {
    "mujoco": _mujoco,
    "allocation": lambda vehicle, *_: (allocation_files(vehicle), Exported({})),
    "ardusub-gains": _ardusub_gains,
    "autopilot": _autopilot,
    "gains": _gains,
}


def _exported_file(vehicle: Vehicle, to: str, path: Path, inputs: list[Path], options: Options) -> Exported:
    """Write the model for Gazebo, or the robot description."""
    check_targets([(path, GAZEBO_MODEL)], inputs, force=options.force)
    model: Model = (
        urdf_model(vehicle)
        if to == "urdf"
        else gazebo_model(vehicle, in_world=options.in_world, explicit=options.added_mass == "plugin")
    )
    written = write_whole(Output(path, sealed(model.text, "export").encode()), force=options.force)
    following = shell_words("gz", "sim", "-r", path) if options.in_world else ""
    if to == "sdf" and not following:
        following = "include it in a world, or give --world"
    return Exported(written, "What is different in Gazebo", model.notes, model.warnings, following)
