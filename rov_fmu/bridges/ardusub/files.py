"""The files of ArduSub's gains: parameters for ground stations, the table and the picture of the flight."""

from collections.abc import Iterator
from functools import partial
from math import degrees, inf, nan, radians

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from rov_fmu.bridges.ardusub.gains import HEAD, NEW_NAMES, REST, Tuned
from rov_fmu.bridges.ardusub.law import FIRMWARE, RATE
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.io.messages import one_line
from rov_fmu.report.console import table, text
from rov_fmu.report.plots.png import png_file
from rov_fmu.report.plots.svg import LIGHT, add_legend, name_axes
from rov_fmu.tank.arrays import Array

_USE = """
# For {}. The ground station leaves out the names that the vehicle does not have:
# ArduSub has PSC_POSZ, PSC_VELZ and PSC_ACCZ before 4.7, and PSC_D_POS, PSC_D_VEL and PSC_D_ACC from 4.7 on.
# Fly these gains in the simulator first, and limit the thrust in the pool: docs/gains.md
"""
_COLUMNS = ("overshoot", "settled in s", "error at rest", "changes of commands per s")
_SHOWN = {HEAVE: ("depth", 3, 100.0, "cm", 0.05), YAW: ("heading", 2, degrees(1.0), "deg", radians(2.0))}
"""The words, the row of the errors and demands, the factor and the unit that people read, and what counts as settled
(m, rad), by axis."""
_THINNED = 8
"""The samples from one point of a line to the next."""


def gains_files(tuned: Tuned) -> dict[str, str | bytes]:
    """Return the files of the folder by name."""
    lines = [",".join(["leg", "unit", *(f"{column} ({of})" for column in _COLUMNS for of in ("firmware", "these"))])]
    lines += [",".join([leg, unit, *(f"{x:.4g}" for x in cells[:, ::-1].flat)]) for leg, unit, cells in _rows(tuned)]
    return {
        "gains.param": _parameters(tuned, "MAVProxy: param load gains.param", "{} {:.4g}"),
        "gains.params": _parameters(tuned, "QGroundControl: Parameters, Tools, Load from file", "1\t1\t{}\t{:.4g}\t9"),
        "steps.csv": "\n".join([*lines, ""]),
        "steps.png": png_file(partial(_draw, tuned=tuned), (9.0, 6.5), background="white", margin=0.05),
    }


def _parameters(tuned: Tuned, use: str, form: str) -> str:
    """Return the parameters with their reasons, in the form of a ground station."""
    named = f"{tuned.vehicle.identifier}, frame {tuned.frame}: {one_line(tuned.vehicle.name)}"
    lines = [f"{HEAD}{named}{_USE.format(use)}", *(f"# {one_line(note)}" for note in tuned.notes)]
    for name, (value, reason) in tuned.gains.items():
        lines += ["", f"# {name}: {one_line(reason)} (the firmware's is {FIRMWARE[name]:g})", form.format(name, value)]
        lines += [form.format(name.replace(o, n), f * value) for o, (n, f) in NEW_NAMES.items() if name.startswith(o)]
    return "\n".join([*lines, ""])


def _rows(tuned: Tuned) -> Iterator[tuple[str, str, Array]]:
    """Yield for each leg what it is, its unit, and the _COLUMNS with these gains and with the firmware's (4 x 2).

    The overshoot is the largest error beyond the target; ahead, the largest error. The vehicle is settled when it stays
    within 5 cm or 2 deg, s. The error at rest is that of the last 2 s, RMS. The changes of the commands in a second, 1
    being the full command, are the mean over the thrusters.
    """
    for flown in tuned.legs[1:]:
        leg = flown.leg
        changes = np.abs(np.diff(flown.fractions[..., :2], axis=0)).mean(axis=1).sum(axis=0) / leg.seconds
        for axis, (words, row, scale, unit, within) in _SHOWN.items():
            if not tuned.vehicle.layout.has(axis) or leg.axis not in (axis, SURGE):
                continue
            errors = flown.errors[:, row, :2]
            settled = (RATE * leg.seconds - (np.abs(errors[::-1]) > within).argmax(axis=0)) / RATE
            settled[np.abs(errors[-1]) > within] = inf
            over, title = (errors * np.sign(leg.size)).max(axis=0).clip(0.0), f"{words} {scale * leg.size:+.0f} {unit}"
            if leg.axis is SURGE:
                settled, over, title = np.full(2, nan), np.abs(errors).max(axis=0), f"{leg.size:.0%} ahead: {words}"
            rest = np.sqrt((errors[-REST:] ** 2).mean(axis=0))
            yield title, unit, np.array([scale * over, settled, scale * rest, changes])


def table_of(tuned: Tuned) -> Table:
    """Return the table of the flight for people: with the firmware's gains, and after the arrow with these."""
    shown = table("A flight with the firmware's gains → with these", "leg", _COLUMNS)
    for leg, unit, cells in _rows(tuned):
        pairs = [["never" if x == inf else text(x, ".2f") for x in pair[::-1]] for pair in cells]
        units = (f" {unit}", "", f" {unit}", "")
        shown.add_row(leg, *(f"{old} → {new}{of}" for (old, new), of in zip(pairs, units, strict=True)))
    return shown


def _draw(figure: Figure, tuned: Tuned) -> None:
    """Draw depth and heading with their targets, and the demands, with these gains and with the firmware's."""
    axes = [axis for axis in _SHOWN if tuned.vehicle.layout.has(axis)]
    panels = figure.subplots(2 * len(axes), sharex=True, squeeze=False, height_ratios=[1.0, 0.6] * len(axes))[:, 0]
    for n, axis in enumerate(axes):
        words, row, scale, unit, _ = _SHOWN[axis]
        target = np.cumsum([leg.leg.size * (leg.leg.axis is axis) for leg in tuned.legs])
        targets = np.repeat(target, [len(leg.errors) for leg in tuned.legs])[::_THINNED, np.newaxis]
        errors, demands = (
            np.concatenate([part[:, row, 1::-1] for part in parts])[::_THINNED]
            for parts in ([leg.errors for leg in tuned.legs], [leg.demands for leg in tuned.legs])
        )
        time = np.arange(len(targets)) * _THINNED / RATE
        panels[2 * n].plot(time, scale * targets, color=LIGHT["muted"], linewidth=0.8, label="target")
        for panel, lines in ((panels[2 * n], scale * (targets + errors)), (panels[2 * n + 1], 100.0 * demands)):
            for line, color, label in zip(lines.T, ("orange", "blue"), ("firmware's", "these gains"), strict=True):
                panel.plot(time, line, color=LIGHT[color], linewidth=1.2, label=label)
        name_axes(panels[2 * n], f"{words} from the start", unit)
        name_axes(panels[2 * n + 1], f"demand of {axis.name}", "%")
    panels[-1].set_xlabel("time (s)")
    add_legend(figure, 3)
