"""The files of ArduSub's gains: parameters for ground stations, the table and the picture of the flight."""

from functools import partial
from math import inf

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from rov_fmu.autopilot.ardusub import RATE, ROWS
from rov_fmu.bridges.ardusub.gains import FIGURES, HEAD, NEW_NAMES, RANGES, SHOWN, Tuned, figures
from rov_fmu.equation.catalogue import HEAVE, YAW
from rov_fmu.io.messages import one_line
from rov_fmu.report.console import table, text
from rov_fmu.report.plots.png import png_file
from rov_fmu.report.plots.svg import LIGHT, add_legend, name_axes

_GENERATIONS = {"before-4.7": {}, "from-4.7": NEW_NAMES}
"""The new names by what the versions of ArduSub are called in the names of files."""
_STATIONS = {
    "param": ("MAVProxy: param load", "{} {:.4g}"),
    "params": ("QGroundControl: Parameters, Tools, Load from file", "1\t1\t{}\t{:.4g}\t9"),
}
"""How a ground station loads a file, and a line of it, by the suffix of the file."""
_USE = """
# For ArduSub {}. {}
# Fly these gains in the simulator first, and limit the thrust in the pool: docs/gains.md
"""
_UNSCALED = "a tenth of PSC_ACCZ_FF. ArduPilot's conversion to 4.7 leaves it as it was: load this file after it"
_THINNED = 8
"""The samples from one point of a line to the next."""


def gains_files(tuned: Tuned) -> dict[str, str | bytes]:
    """Return the files of the folder by name."""
    lines = [",".join(["leg", "unit", *(f"{column} ({of})" for column in FIGURES for of in (tuned.whose, "these"))])]
    lines += [
        ",".join([leg, unit, *(f"{x:.4g}" for x in cells[:, ::-1].flat)])
        for _, leg, unit, cells in figures(tuned.vehicle, tuned.legs)
    ]
    return {
        **{
            f"gains-{version}.{suffix}": _parameters(tuned, version, suffix)
            for version in _GENERATIONS
            for suffix in _STATIONS
        },
        "steps.csv": "\n".join([*lines, ""]),
        "steps.png": png_file(partial(_draw, tuned=tuned), (9.0, 6.5), background="white", margin=0.05),
    }


def _parameters(tuned: Tuned, version: str, suffix: str) -> str:
    """Return the parameters with their reasons, with the names of a version of ArduSub, for a ground station."""
    use, form = _STATIONS[suffix]
    named = f"{tuned.vehicle.identifier}, frame {tuned.frame}: {one_line(tuned.vehicle.name)}"
    lines = [
        f"{HEAD}{named}{_USE.format(version.replace('-', ' '), use)}",
        *(f"# {one_line(note)}" for note in tuned.notes),
    ]
    for name, (value, reason) in tuned.gains.items():
        new = [(name.replace(o, n), f) for o, (n, f) in _GENERATIONS[version].items() if name.startswith(o)]
        own, factor = new[0] if new else (name, 1.0)
        low, high = (factor * end for end in RANGES[name])
        usual = f"{tuned.whose} is {factor * tuned.usual[name]:g}, documented are {low:g} to {high:g}"
        lines += ["", f"# {own}: {one_line(reason)} ({usual})", form.format(own, factor * value)]
        lines[-1:-1] = [f"# {own}: {_UNSCALED}"] if own == "PSC_D_ACC_FF" else []
    return "\n".join([*lines, ""])


def flight_table(tuned: Tuned) -> Table:
    """Return the table of the flight for people: with the usual gains, and after the arrow with these.

    Below are the figures by which the gains of an axis are written or left out.
    """
    shown = table(f"A flight with {tuned.whose} gains → with these", "leg", FIGURES)
    for _, leg, unit, cells in figures(tuned.vehicle, tuned.legs):
        pairs = [["never" if x == inf else text(x, ".2f") for x in pair[::-1]] for pair in cells]
        units = (f" {unit}", "", f" {unit}", "")
        shown.add_row(leg, *(f"{old} → {new}{of}" for (old, new), of in zip(pairs, units, strict=True)))
    for axis, ratios in tuned.compared.items():
        is_written = any(ROWS[axis] in name for name in tuned.gains)
        words = "written" if is_written else "left out"
        shown.add_row(f"{axis.name}, also 20 ms later: of {tuned.whose}", *(f"{ratio:.0%}" for ratio in ratios), words)
    return shown


def _draw(figure: Figure, tuned: Tuned) -> None:
    """Draw depth and heading with their targets, and the demands, with these gains and with the firmware's."""
    axes = [axis for axis in (HEAVE, YAW) if tuned.vehicle.layout.has(axis)]
    panels = figure.subplots(2 * len(axes), sharex=True, squeeze=False, height_ratios=[1.0, 0.6] * len(axes))[:, 0]
    for n, axis in enumerate(axes):
        words, row, scale, unit, _ = SHOWN[axis]
        target = np.cumsum([leg.leg.size * (leg.leg.axis is axis) for leg in tuned.legs])
        targets = np.repeat(target, [len(leg.errors) for leg in tuned.legs])[::_THINNED, np.newaxis]
        errors, demands = (
            np.concatenate([part[:, row, 1::-1] for part in parts])[::_THINNED]
            for parts in ([leg.errors for leg in tuned.legs], [leg.demands for leg in tuned.legs])
        )
        time = np.arange(len(targets)) * _THINNED / RATE
        panels[2 * n].plot(time, scale * targets, color=LIGHT["muted"], linewidth=0.8, label="target")
        for panel, lines in ((panels[2 * n], scale * (targets + errors)), (panels[2 * n + 1], 100.0 * demands)):
            for line, color, label in zip(lines.T, ("orange", "blue"), (tuned.whose, "these gains"), strict=True):
                panel.plot(time, line, color=LIGHT[color], linewidth=1.2, label=label)
        name_axes(panels[2 * n], f"{words} from the start", unit)
        name_axes(panels[2 * n + 1], f"demand of {axis.name}", "%")
    panels[-1].set_xlabel("time (s)")
    add_legend(figure, 3)
