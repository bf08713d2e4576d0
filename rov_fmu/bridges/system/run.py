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
    """Return the outputs that are connected and are numbers, without those of the nodes of tethers."""
    starts = _shown_starts(structure)
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
    """Return the plot of some variables, or of those that change and pass between the components, and of forces that no
    terminal has, such as the tension of a tether.

    Each quantity has a panel: what a component, or one end or point of it, has in one unit.
    """
    columns = {".".join(name): n for n, name in enumerate(read)}
    plain = [name for name in columns if not re.search("_p?[0-9]+$", name)] or columns
    passed = dict.fromkeys([".".join(name) for name in _shown_starts(structure)] or plain)
    parts, members = structure.parts, _members(structure)
    alone = [name for name in read if name not in members and parts[name[0]].variables[name[1]].unit == "N"]
    passed |= dict.fromkeys(map(".".join, alone))
    chosen = names or [name for name in passed if name in columns and np.ptp(rows[:, columns[name]])]
    panels = [*_panels(structure, [read[columns[name]] for name in chosen], is_chosen=bool(names))]

    def draw(figure: Figure) -> None:
        axes = figure.subplots(max(1, len(panels)), sharex=True, squeeze=False)[:, 0]
        for panel, (unit, title, some) in zip(axes, panels, strict=False):
            factor, printed = (100.0, "%") if unit == "1" else in_degrees(unit)
            for color, (component, name) in zip(_COLORS, some, strict=False):
                values = factor * rows[:, columns[f"{component}.{name}"]]
                panel.plot(step * np.arange(len(rows)), values, linewidth=1.2, label=name, color=LIGHT[color])
            name_axes(panel, title, printed)
            panel.legend(loc="center left", bbox_to_anchor=(1.1, 0.5))
        axes[-1].set_xlabel("time (s)")

    return svg_file(draw, (8.6, 1.0 + 1.9 * max(1, len(panels))), salt="system")


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
