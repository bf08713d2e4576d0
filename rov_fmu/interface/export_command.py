"""The command `rov-fmu export`: the formats in which a vehicle can be written, and the writing.

What a format needs is imported when it is written, so that the command line has the table of formats at once.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rov_fmu.io.file_kinds import GAZEBO_MODEL
from rov_fmu.io.messages import InputError, listed
from rov_fmu.io.output import Output, check_targets, sealed, write_whole

if TYPE_CHECKING:
    from rich.table import Table

    from rov_fmu.vehicle.vehicle import Vehicle

_TAKEN = {"mujoco", "numpy", *sys.stdlib_module_names}
"""The names of modules that the folder for MuJoCo imports, directly or through others."""
_OF_CARD = ("Where it holds", "How far to trust it", "What it leaves out")
_IN_GAZEBO = "What is different in Gazebo"


@dataclass(frozen=True)
class Job:
    """A vehicle, the path to write it to, and what the options of the command say. A format reads those that it has."""

    vehicle: "Vehicle"
    path: Path
    in_world: bool = False
    """True for a world with water around the model for Gazebo."""
    added_mass: str | None = None
    """`plugin` for the added mass in Gazebo's Hydrodynamics plugin, in place of the link."""
    draws: int | None = None
    """The number of sets of coefficients to draw for MuJoCo."""
    seed: int | None = None
    """That of the draws."""
    gains: Path | None = None
    """A file with the parameters that ArduSub has, whose gains are to be beaten."""
    force: bool = False
    """True to replace files of others, and to draw also where an axis is not fit for use."""


@dataclass(frozen=True)
class Exported:
    """What a format makes of a vehicle, and what the reader of the console should know."""

    files: Mapping[str, str | bytes]
    """The files of the folder by their names. A format that is one file has an empty name for it."""
    notes: Sequence[str] = ()
    heading: str = "Note"
    """What the notes are about."""
    warnings: Sequence[str] = ()
    following: str = ""
    """The next command."""
    table: "Table | None" = None
    """What a flight showed."""


@dataclass(frozen=True)
class Export:
    """A format of the command."""

    name: str
    """What `--to` takes."""
    end: str
    """The end of the usual path, after the identifier of the vehicle."""
    write: Callable[[Job], Exported]
    """Makes the files, which the command writes. Raises InputError about what the format cannot have."""
    words: str
    """What it is, in the help."""
    also: str = ""
    """Another word for it that people use."""
    kind: str = ""
    """The kind of its file (`file_kinds`); a format without one is a folder of files."""


def export(
    vehicle: Path, to: str, output: Path | None, *, settings: Sequence[str] = (), **options: Any
) -> tuple[Exported, dict[Path, str]]:
    """Write a vehicle in a format of EXPORTS, with the options of a Job.

    `settings` are coefficients as `NAME=VALUE`, such as `T_d=0.02`, in place of those of the file.

    Return what was made, and the file or the folder that was written, with what it replaced. Raises FileError,
    InputError about an option or a vehicle that the format cannot have, and WriteError.
    """
    from rov_fmu.interface.simulate_command import with_settings
    from rov_fmu.vehicle.vehicle import load_vehicle

    chosen = EXPORTS[to]
    loaded, given = with_settings(load_vehicle(vehicle), settings)
    if others := [*given.inputs, *given.start]:
        raise InputError(f"--set {others[0]}: an export has coefficients alone, such as T_d=0.02")
    path = output or Path(f"{loaded.identifier}{chosen.end}")
    job = Job(loaded, path, **options)
    if not chosen.kind and path.is_file():
        raise InputError(f"{path}: is a file, and --to {to} writes a folder")
    made = chosen.write(job)
    if not chosen.kind:
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}")
        path.mkdir(exist_ok=True)
    inputs = [vehicle, *loaded.files, *filter(None, [job.gains])]
    check_targets([(path / name, chosen.kind) for name in made.files], inputs, force=job.force)
    contents = {path / name: file.encode() if isinstance(file, str) else file for name, file in made.files.items()}
    written = write_whole(*(Output(*one) for one in contents.items()), force=job.force)
    return made, {path: listed(dict.fromkeys(filter(None, written.values())))}


def _mujoco(job: Job) -> Exported:
    import numpy as np

    from rov_fmu.bridges.mujoco import mujoco_files, mujoco_texts
    from rov_fmu.fmu.card import card
    from rov_fmu.report.console import shell_words

    vehicle, path = job.vehicle, job.path
    if job.seed is not None and job.draws is None:
        raise InputError("--to mujoco: leave out --seed, or give --draws as well")
    if not path.name.isidentifier() or iskeyword(path.name) or path.name in _TAKEN:
        reason = "begin with a letter, have only letters, digits and _, and not be that of another module"
        raise InputError(f"{path}: programs import this folder, so its name must {reason}")
    generator = np.random.default_rng(job.seed or 0)
    drawn = {} if job.draws is None else vehicle.draws(job.draws, generator, forced=job.force)
    columns = {name: column.tolist() for name, column in drawn.items()}
    paragraphs = card(vehicle)
    shown = {heading: paragraphs[heading] for heading in _OF_CARD}
    there = f"{shell_words('cd', path.parent)} && " if path.parent != Path() else ""
    files = mujoco_files(mujoco_texts(vehicle, path.name, shown, columns))
    return Exported(files, following=f"{there}python -m {path.name}")


def _allocation(job: Job) -> Exported:
    from rov_fmu.bridges.allocation import allocation_files

    return Exported(allocation_files(job.vehicle))


def _autopilot(job: Job) -> Exported:
    from rov_fmu.bridges.autopilot.files import autopilot_files

    named = job.path / f"{job.vehicle.identifier}_autopilot.fmu"
    words = f"connect {named} with the FMU of the vehicle: pose, velocities and thrusters (docs/system.md)"
    return Exported(autopilot_files(job.vehicle), following=words)


def _gains(job: Job) -> Exported:
    from rov_fmu.bridges.autopilot.files import gains_yaml

    return Exported(gains_yaml(job.vehicle))


def _ardusub_gains(job: Job) -> Exported:
    from rov_fmu.bridges.ardusub.files import flight_table, gains_files
    from rov_fmu.bridges.ardusub.gains import tuned

    found = tuned(job.vehicle, job.gains)
    following = f"fly {job.path / 'gains-from-4.7.param'} (or before-4.7) by rov-fmu sitl, and then in the pool"
    return Exported(gains_files(found), found.notes, following=following, table=flight_table(found))


def _sdf(job: Job) -> Exported:
    from rov_fmu.bridges.sdf import gazebo_model
    from rov_fmu.report.console import shell_words

    model = gazebo_model(job.vehicle, in_world=job.in_world, explicit=job.added_mass == "plugin")
    run = shell_words("gz", "sim", "-r", job.path)
    following = run if job.in_world else "include it in a world, or give --world"
    return Exported({"": sealed(model.text, "export")}, model.notes, _IN_GAZEBO, model.warnings, following)


def _urdf(job: Job) -> Exported:
    from rov_fmu.bridges.urdf import urdf_model

    model = urdf_model(job.vehicle)
    return Exported({"": sealed(model.text, "export")}, model.notes, _IN_GAZEBO)


EXPORTS = {
    one.name: one
    for one in (
        Export("mujoco", "_mujoco", _mujoco, "MuJoCo", "mjcf"),
        Export("allocation", "_allocation", _allocation, "the allocation of thrust"),
        Export("autopilot", "_autopilot", _autopilot, "an autopilot (FMU)"),
        Export("gains", "_gains", _gains, "its gains"),
        Export("ardusub-gains", "_ardusub_gains", _ardusub_gains, "those of ArduSub", "ardusub"),
        Export("sdf", ".sdf", _sdf, "Gazebo (SDFormat)", "gazebo", GAZEBO_MODEL),
        Export("urdf", ".urdf", _urdf, "ROS 2 (URDF)", "ros", GAZEBO_MODEL),
    )
}
"""The formats by their names, in the order of the help."""
