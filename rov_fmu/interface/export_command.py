"""The command `rov-fmu export`: the files of a vehicle for other simulators, thruster managers and ArduSub."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rov_fmu.autopilot.gains import unknown_lags
from rov_fmu.bridges.allocation import allocation_files
from rov_fmu.bridges.mujoco import mujoco_files, mujoco_texts
from rov_fmu.bridges.sdf import gazebo_model
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


def export(
    vehicle: Path,
    to: str,
    output: Path | None,
    *,
    in_world: bool = False,
    added_mass: str | None = None,
    draws: int | None = None,
    seed: int | None = None,
    gains: Path | None = None,
    force: bool = False,
) -> Exported:
    """Write a vehicle in a format: mujoco, allocation, autopilot, gains, ardusub-gains, sdf, urdf.

    - `in_world`: True for a world with water around the model for Gazebo.
    - `added_mass`: "plugin" for the added mass in Gazebo's Hydrodynamics plugin, in place of the link.
    - `draws`, `seed`: the number of sets of coefficients to draw for MuJoCo, and the seed.
    - `gains`: a file with parameters of ArduSub, whose gains are flown in place of the vehicle's own.
    - `force`: True to replace files of others, and to draw also where an axis is not fit for use.

    Raises FileError, InputError about an option or a vehicle that the format cannot have, and WriteError.
    """
    if seed is not None and draws is None:
        raise InputError(f"--to {to}: leave out --seed, or give --draws as well")
    loaded = load_vehicle(vehicle)
    path = output or Path(f"{loaded.identifier}{_ENDS[to]}")
    inputs = [vehicle, *loaded.files, *filter(None, [gains])]
    if to in ("sdf", "urdf"):
        model = (
            urdf_model(loaded)
            if to == "urdf"
            else gazebo_model(loaded, in_world=in_world, explicit=added_mass == "plugin")
        )
        check_targets([(path, GAZEBO_MODEL)], inputs, force=force)
        written = write_whole(Output(path, sealed(model.text, "export").encode()), force=force)
        add = "include it in a world, or give --world" if to == "sdf" else ""
        following = shell_words("gz", "sim", "-r", path) if in_world else add
        return Exported(written, "What is different in Gazebo", model.notes, model.warnings, following)
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, and --to {to} writes a folder")
    files, found = _contents(loaded, to, path, draws, seed or 0, gains, force=force)
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    path.mkdir(exist_ok=True)
    check_targets([(path / name, "") for name in files], inputs, force=force)
    contents = {name: file.encode() if isinstance(file, str) else file for name, file in files.items()}
    written = write_whole(*(Output(path / name, file) for name, file in contents.items()), force=force)
    return replace(found, written={path: listed(dict.fromkeys(filter(None, written.values())))})


def _contents(
    vehicle: Vehicle, to: str, path: Path, draws: int | None, seed: int, gains: Path | None, *, force: bool
) -> tuple[Mapping[str, str | bytes], Exported]:
    """Return the files of a folder by name, and what is printed. Raises InputError."""
    match to:
        case "mujoco":
            if not path.name.isidentifier() or iskeyword(path.name) or path.name in _TAKEN:
                reason = "begin with a letter, have only letters, digits and _, and not be that of another module"
                raise InputError(f"{path}: programs import this folder, so its name must {reason}")
            drawn = {} if draws is None else vehicle.draws(draws, np.random.default_rng(seed), forced=force)
            columns = {name: column.tolist() for name, column in drawn.items()}
            paragraphs = card(vehicle)
            shown = {heading: paragraphs[heading] for heading in _OF_CARD}
            files = mujoco_files(mujoco_texts(vehicle, path.name, shown, columns))
            there = f"{shell_words('cd', path.parent)} && " if path.parent != Path() else ""
            return files, Exported({}, following=f"{there}python -m {path.name}")
        case "ardusub-gains":
            from rov_fmu.bridges.ardusub.files import flight_table, gains_files  # Matplotlib: few need it
            from rov_fmu.bridges.ardusub.gains import tuned

            found = tuned(vehicle, gains)
            following = f"fly {path / 'gains-from-4.7.param'} (or before-4.7) by rov-fmu sitl, and then in the pool"
            return gains_files(found), Exported({}, "Note", found.notes, following=following, table=flight_table(found))
        case "autopilot":
            from rov_fmu.bridges.autopilot.files import autopilot_files

            named = path / f"{vehicle.identifier}_autopilot.fmu"
            words = f"connect {named} with the FMU of the vehicle: pose, velocities and thrusters (docs/system.md)"
            notes = [*unknown_lags(vehicle)]
            return autopilot_files(vehicle), Exported({}, "Note", notes, following=words)
        case "gains":
            from rov_fmu.bridges.autopilot.files import gains_yaml

            return gains_yaml(vehicle), Exported({}, "Note", [*unknown_lags(vehicle)])
    return allocation_files(vehicle), Exported({})
