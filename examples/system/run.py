"""Build the system, run it in every engine, compare, and draw it: python -m examples.system.run

It ends with 1 where two engines differ, or where the vehicle is not held.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from math import degrees, pi
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rov_fmu.io.output import Output, sealed, write_whole
from rov_fmu.report.plots.svg import LIGHT, name_axes, svg_file

from .engines import ENGINES, Trajectory, plain
from .system import DEFAULT, MISSION, STEP, STEPS, build_system, parameter_sets

HELD_FROM = 30.0  # s; dive and turn are over
DEPTH, HEADING = 0.02, 2.0  # m and deg: what counts as held
SAME = 1e-9  # largest difference of any output from the loop without an engine, SI units

TIME = STEP * np.arange(1, STEPS + 1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m examples.system.run", description=__doc__)
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path("build/system"),
        help="where the files of the system go (default: %(default)s)",
    )
    parser.add_argument("--figure", type=Path, metavar="FILE.svg", help="the picture (default: in that folder)")
    parser.add_argument("--force", action="store_true", help="replace a picture that this command did not write")
    options = parser.parse_args(arguments)
    folder: Path = options.folder
    build_system(folder)
    good, drawn = True, {}
    for parameters in parameter_sets():
        print(f"\n{parameters}")
        expected = drawn[parameters] = plain(parameters)
        good &= report("no engine", expected, expected)
        for name, engine in ENGINES.items():
            if reason := engine.missing():
                print(f"  {name:<16}not run: {reason}")
                continue
            good &= report(name, engine.run(folder, parameters), expected)
        hasty = difference(plain(parameters, sequential=True), expected)
        print(
            "  a master that steps one after the other would differ by up to "
            f"{1000 * hasty['rov.z']:.1f} mm and {degrees(hasty['rov.psi']):.2f} deg"
        )
    figure = options.figure or folder / "system.svg"
    draw(drawn, figure, force=options.force)
    print(f"\n{figure}")
    return 0 if good else 1


def report(name: str, result: Trajectory, expected: Trajectory) -> bool:
    """Print how well the vehicle is held, and how far from what is expected; whether both are good."""
    largest = max(difference(result, expected).values())
    depth, heading = held(result)
    good = bool(largest <= SAME and depth <= DEPTH and heading <= HEADING)
    print(
        f"  {name:<16}depth within {1000 * depth:.2f} mm, heading within {heading:.4f} deg from {HELD_FROM:g} s on; "
        f"difference {largest:.1e}  {'ok' if good else 'FAILED'}"
    )
    return good


def difference(a: Trajectory, b: Trajectory) -> dict[str, float]:
    """The largest difference of each output (SI units)."""
    return {name: float(np.max(np.abs(a[name] - b[name]))) for name in b}


def held(result: Trajectory) -> tuple[float, float]:
    """The largest errors of depth (m) and heading (deg) once the manoeuvre is over."""
    late = TIME >= HELD_FROM
    depth = np.abs(result["rov.z"][late] - MISSION["ref_z"])
    heading = np.abs(result["rov.psi"][late] - MISSION["ref_psi"])
    return float(depth.max()), degrees(float(heading.max()))


def draw(results: Mapping[str, Trajectory], path: Path, *, force: bool) -> None:
    """Draw depth, heading, track, commands, current and battery to an SVG file."""

    def drawn(figure: Figure) -> None:
        depth, heading, track, commands, current, battery = figure.subplots(3, 2).flat
        t = TIME[::6]
        blue = {"color": LIGHT["blue"]}
        for parameters, result in results.items():
            few = {name: values[::6] for name, values in result.items()}
            is_default = parameters == DEFAULT
            line: dict[str, Any] = {"linewidth": 1.6 if is_default else 1.1, "linestyle": "-" if is_default else "--"}
            depth.plot(t, few["rov.z"], **blue, **line, label=parameters)
            heading.plot(t, np.degrees(few["rov.psi"]), **blue, **line)
            track.plot(few["rov.y"], few["rov.x"], **blue, **line)
            for name, role in (("u_l", "teal"), ("u_r", "violet"), ("u_t", "orange")):
                label = name if is_default else None
                commands.plot(t, 100.0 * few[f"autopilot.{name}"], color=LIGHT[role], **line, label=label)
            battery.plot(t, 100.0 * few["battery.sag"], color=LIGHT["teal"], **line, label=parameters)
        wanted: Any = {"color": LIGHT["orange"], "linewidth": 1.3, "linestyle": ":", "label": "wanted"}
        depth.axhline(MISSION["ref_z"], **wanted)
        heading.axhline(degrees(MISSION["ref_psi"]), **wanted)
        for name, role in (("V_N", "teal"), ("V_E", "violet")):
            current.plot(t, few[f"current.{name}"], color=LIGHT[role], linewidth=1.6, label=name)
        track.plot(0.0, 0.0, "o", markersize=4.5, **blue)
        track.set_aspect("equal", adjustable="datalim")
        for ax, quantity, unit, x in (
            (depth, "depth", "m", "time (s)"),
            (heading, "heading", "deg", "time (s)"),
            (track, "way to the north", "m", "way to the east (m)"),
            (commands, "commands", "%", "time (s)"),
            (current, "current", "m/s", "time (s)"),
            (battery, "drop of the voltage", "%", "time (s)"),
        ):
            name_axes(ax, quantity, unit, x)
        heading.set_yticks(np.arange(0.0, degrees(pi / 2) + 1.0, 15.0))
        for ax in (depth, commands, current, battery):
            ax.legend()
        depth.invert_yaxis()

    svg = svg_file(drawn, (8.6, 9.2), salt="system", background=LIGHT["page"])
    write_whole(Output(path, sealed(svg).encode()), force=force)


if __name__ == "__main__":
    sys.exit(main())
