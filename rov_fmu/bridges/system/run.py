"""Run a system from its start to its end, in a child process, as a table and as a plot."""

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rov_fmu.bridges.system.connections import SystemStructure
from rov_fmu.bridges.system.half_step import HalfStep
from rov_fmu.bridges.system.master import Master, Name, busy, folders_of
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.bridges.system.sensors import TRUE
from rov_fmu.equation.units import in_degrees
from rov_fmu.fmus.description import TIME_LIMIT, budget
from rov_fmu.fmus.instance import Array, RunError
from rov_fmu.io.child_process import ChildError, ChildProcess
from rov_fmu.io.groups import grouped
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, Progress, silent
from rov_fmu.io.numbers import csv_of
from rov_fmu.report.plots.svg import LIGHT, LINES, name_axes, svg_file

_COLORS = (*LINES, "grey")
"""The colours of the lines of a panel."""
_QUANTITIES = {"N": "force", "m": "place", "rad": "angle", "m/s": "velocity", "rad/s": "rate"}
"""The words for what a panel shows, by its unit."""
_NODE, _LEVEL, _PLACE = "_p[0-9]+$", "_[0-9]+$", "^[xyz]$"
"""Members of terminals: a tether's at each node, a profile's at each level, and the place of a vehicle or an end."""
_AIMS = {"x": "u", "y": "v", "z": "w", "phi": "p", "theta": "q", "psi": "r"}
"""What an autopilot holds, each with the axis of its mode."""
_HOLDS = 1.5
"""From where on a mode of an autopilot holds a place or an angle."""
_QUATERNION = "^(eta|epsilon_.)$"
_TOLD = f"{_QUATERNION}|^(vg_[NED]|A_[NED]|[xyz]|[uvwpqr])$"
"""Members of terminals that say in other words how a vehicle moves, or are told only so that another can compute."""
_CALL = 0.5
"""The time that some steps should take, s. They are one call of the child process, and one step of the progress."""

_MOST = 100_000_000
"""The most values of a run, which are in memory."""


class SystemRun(NamedTuple):
    """What a run gave."""

    rows: Array
    """The variables at the start and after each step, a row for each."""
    warnings: list[str]
    """What the FMUs warned of."""


def recorded_names(structure: SystemStructure) -> list[Name]:
    """Return all outputs of a system that are numbers."""
    return [(component, name) for component, part in structure.parts.items() for name in part.numbers("output")]


def _members(structure: SystemStructure, form: str = "") -> set[Name]:
    """Return the variables that are members of terminals with such names."""
    return {
        (component, name)
        for component, part in structure.parts.items()
        for members in part.terminals.values()
        for member, name in members.items()
        if re.search(form, member)
    }


def _shown_starts(structure: SystemStructure) -> dict[Name, None]:
    """Return the outputs that are connected, without those by which a seaway and the nodes of a tether tell each other
    where they are and how the water moves."""
    nodes = _members(structure, _NODE)
    return {one.start: None for one in structure.connections if one.start not in nodes}


def passed(structure: SystemStructure) -> list[Name]:
    """Return the outputs that are connected and are numbers, without those of the nodes of tethers and quaternions,
    which may change by nothing but rounding while a vehicle does not turn."""
    starts = _shown_starts(structure).keys() - _members(structure, _QUATERNION)
    return [name for name in recorded_names(structure) if name in starts]


def run_system(
    structure: SystemStructure,
    path: Path,
    read: Sequence[Name],
    step: float,
    steps: int,
    on_progress: Progress = silent,
    parts: int = 1,
    time_limit: float = TIME_LIMIT,
) -> SystemRun:
    """Run a system. Each step is made of some `parts`, between which the FMUs exchange values, too.

    - `time_limit`: the time in which the FMUs must begin, and take a step together, s.

    Raises FileError about the path.
    """
    if (count := (steps + 1) * len(read)) > _MOST:
        raise FileError(
            f"{path}: {steps} steps of {len(read)} variables give {count:,} values; at most {_MOST:,} are kept"
        )
    rows = list[Array]()
    with temporary_folder("system-") as folder, ExitStack() as stack:
        try:
            for name, own in folders_of(folder, structure.parts).items():
                structure.parts[name].unpack(own)
            system = folder, [*structure.parts], structure.connections, read
            child = ChildProcess(Master, *system, limits=budget(time_limit))
            stack.enter_context(closing(child))
            rows.append(np.array([child.call("begin", structure.values, step / parts, step * steps)]))
            done, count = 0, 1
            while done < steps:
                began = perf_counter()
                rows.append(np.array(child.call("step", parts * min(count, steps - done))[parts - 1 :: parts]))
                done += len(rows[-1])
                count = max(1, min(2 * count, int(count * _CALL / (perf_counter() - began + 1e-9))))
                on_progress("running", done / steps)
            warnings = child.call("warnings")
            child.call("end")
        except (ChildError, RunError) as error:
            who = f"{busy(folder, structure.parts)} " if isinstance(error, ChildError) else ""
            raise FileError(f"{path}: the system cannot be run: {who}{error}") from error
    return SystemRun(np.concatenate(rows), warnings)


def system_csv(read: Sequence[Name], step: float, rows: Array, half: HalfStep | None = None) -> bytes:
    """Return the rows as CSV, with the time first, and at the end what half the step changes."""
    columns = [[n * step for n in range(len(rows))], *rows.T.tolist(), *([half.shares.tolist()] if half else [])]
    names = ["time", *map(".".join, read), *(["half_step"] if half else [])]
    return csv_of(names, zip(*columns, strict=True)).encode()


def picture(structure: SystemStructure, read: Sequence[Name], names: Sequence[str], step: float, rows: Array) -> str:
    """Return the plot of some variables. Without any: how far what an autopilot holds is from its aims, then what else
    is connected and changes, once, and forces that no terminal has, such as the tension of a tether.

    Each quantity has a panel: what a component, or one end or point of it, has in one unit.
    """
    columns = {name: n for n, name in enumerate(read)}
    parts, members = structure.parts, _members(structure)
    off = {} if names else deviations(structure, read, rows)
    plain = [name for name in read if not re.search("_p?[0-9]+$", name[1])] or read
    alone = [name for name in read if name not in members and parts[name[0]].variables[name[1]].unit == "N"]
    hidden = _members(structure, _TOLD) - {(component, name) for component, name in read if name in _AIMS} | off.keys()
    chosen = [(component, name) for component, _, name in (text.partition(".") for text in names)] or [
        name
        for name in dict.fromkeys([*(_shown_starts(structure) or plain), *alone])
        if name in columns and name not in hidden and (rows[:, columns[name]] != rows[0, columns[name]]).any()
    ]
    values = {name: rows[:, columns[name]] for name in chosen} | off
    panels = [(unit, title + " from its aim", some) for unit, title, some in _panels(structure, [*off], is_chosen=True)]
    panels += _panels(structure, chosen, is_chosen=bool(names))

    def draw(figure: Figure) -> None:
        axes = figure.subplots(max(1, len(panels)), sharex=True, squeeze=False)[:, 0]
        for panel, (unit, title, some) in zip(axes, panels, strict=False):
            factor, printed = (100.0, "%") if unit == "1" else in_degrees(unit)
            for color, name in zip(_COLORS, some, strict=False):
                line = step * np.arange(len(rows)), factor * values[name]
                panel.plot(*line, linewidth=1.2, label=name[1], color=LIGHT[color])
            name_axes(panel, title, printed)
            panel.ticklabel_format(useOffset=False)
            beside = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": len(some), "borderpad": 0.0}
            panel.legend(**beside, frameon=False, handlelength=1.0, columnspacing=1.0)
        axes[-1].set_xlabel("time (s)")

    return svg_file(draw, (8.6, 1.0 + 1.9 * max(1, len(panels))), salt="system")


def deviations(structure: SystemStructure, read: Sequence[Name], rows: Array) -> dict[Name, Array]:
    """Return how far each place and angle is from where an autopilot holds it, by its name; NaN while none does.

    Where the autopilot gets them from sensors, those of the vehicle itself are compared.
    """
    columns = {name: n for n, name in enumerate(read)}
    sources = {one.end: one.start for one in structure.connections if one.start in columns}
    found: dict[Name, Array] = {}

    def told(component: str, name: str) -> Name | None:
        source = sources.get((component, name))
        return sources.get((source[0], f"{TRUE}{source[1]}"), source) if source else None

    for component, part in structure.parts.items():

        def series(name: str, component: str = component, part: SystemFmu = part) -> Array:
            if source := told(component, name):
                return rows[:, columns[source]]
            return np.full(len(rows), float(structure.values[component].get(name, part.variables[name].start)))

        for name, axis in _AIMS.items():
            sensor = told(component, name)
            if sensor and {f"mode_{axis}", f"ref_{name}"} <= part.variables.keys():
                change = series(name) - series(f"ref_{name}")
                if part.variables[name].unit == "rad":
                    change = np.remainder(change + np.pi, 2.0 * np.pi) - np.pi
                if (holds := series(f"mode_{axis}") >= _HOLDS).any() and change.any():
                    found[sensor] = np.where(holds, change, np.nan)
    return found


def held_words(structure: SystemStructure, read: Sequence[Name], rows: Array) -> str:
    """Return a line about how well autopilots hold places and angles once they have come there; none without any."""
    most = {"m": (100.0, "cm", 0.0), "rad": (180.0 / np.pi, "deg", 0.0)}
    for (component, name), change in deviations(structure, read, rows).items():
        factor, printed, other = most[unit := structure.parts[component].variables[name].unit]
        late = np.abs(change[len(rows) // 2 :])
        most[unit] = factor, printed, max(other, factor * late.max(where=np.isfinite(late), initial=0.0))
    told = [f"{largest:.2g} {printed}" for _, printed, largest in most.values() if largest]
    return f"from half of the run on: at most {' and '.join(told)} from the aims of the autopilot" if told else ""


def _panels(
    structure: SystemStructure, names: Sequence[Name], *, is_chosen: bool
) -> Iterator[tuple[str, str, Sequence[Name]]]:
    """Yield the unit, the title and the variables of each panel, at most as many as there are colours.

    The levels of a profile are left out unless somebody chose the variables: `V_N_3` is beside `V_N`.
    """
    parts, levels, places = structure.parts, _members(structure, _LEVEL), _members(structure, _PLACE)
    of = {name: (parts[name[0]].variables[name[1]].unit, name[0], _end(parts[name[0]], name[1])) for name in names}
    for (unit, component, end), own in grouped((key, name) for name, key in of.items()).items():
        plain = [name for name in own if name not in levels]
        shown = own if is_chosen or not plain else plain
        owner = ", ".join(filter(None, [component, end]))
        is_known = unit in _QUANTITIES and (unit != "m" or own[0] in places)  # the elevation of a sea is no place
        title = f"{_QUANTITIES[unit]} of {owner}" if is_known else owner
        for some in np.array_split(np.arange(len(shown)), -(-len(shown) // len(_COLORS))):
            yield unit, title, [shown[n] for n in some]


def _end(part: SystemFmu, variable: str) -> str:
    """Return the end or the point that a variable is of: `bottom` of F_N_bottom, which is the F_N of a terminal."""
    pairs = [pair for members in part.terminals.values() for pair in members.items()]
    ends = {name.removeprefix(f"{member}_") for member, name in pairs if name.startswith(f"{member}_")}
    return next((end for end in ends if variable.endswith(f"_{end}")), "")
