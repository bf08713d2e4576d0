"""Build the system, run it in every engine, compare, and draw it: python -m examples.station_keeping.run

It ends with 1 where two engines differ, or where the vehicle is not held.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from math import degrees, pi
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.pages.svg import PALETTE

from .engines import ENGINES, Trajectory, plain
from .system import DEFAULT, MISSION, STEP, STEPS, build_system, parameter_sets

HELD_FROM = 30.0  # s; dive and turn are over
DEPTH, HEADING = 0.02, 2.0  # m and deg: what counts as held
SAME = 1e-9  # largest difference of any output from the loop without an engine, SI units

TIME = STEP * np.arange(1, STEPS + 1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code."""
    options = _parser().parse_args(arguments)
    folder: Path = options.folder
    build_system(folder)
    good, drawn = True, {}
    for parameters in parameter_sets():
        print(f"\n{parameters}")
        expected = drawn[parameters] = plain(folder, parameters)
        good &= report("no engine", expected, expected)
        for name, engine in ENGINES.items():
            if reason := engine.missing():
                print(f"  {name:<16}not run: {reason}")
                continue
            good &= report(name, engine.run(folder, parameters), expected)
        hasty = difference(plain(folder, parameters, sequential=True), expected)
        print("  a master that steps one after the other would differ by up to "
              f"{1000 * hasty['rov.z']:.1f} mm and {degrees(hasty['rov.psi']):.2f} deg")  # fmt: skip
    figure = options.figure or folder / "station_keeping.svg"
    draw(drawn, figure)
    print(f"\n{figure}")
    return 0 if good else 1


def report(name: str, result: Trajectory, expected: Trajectory) -> bool:
    """Print how well the vehicle is held, and how far from what is expected; whether both are good."""
    largest = max(difference(result, expected).values())
    depth, heading = held(result)
    good = bool(largest <= SAME and depth <= DEPTH and heading <= HEADING)
    print(f"  {name:<16}depth within {1000 * depth:.2f} mm, heading within {heading:.4f} deg from {HELD_FROM:g} s on; "
          f"difference {largest:.1e}  {'ok' if good else 'FAILED'}")  # fmt: skip
    return good


def difference(a: Trajectory, b: Trajectory) -> dict[str, float]:
    """The largest difference of each output (SI units)."""
    return {name: float(np.max(np.abs(a[name] - b[name]))) for name in b}


def held(result: Trajectory) -> tuple[float, float]:
    """The largest errors of depth (m) and heading (deg) once the manoeuvre is over."""
    late = TIME >= HELD_FROM
    depth = np.abs(result["rov.z"][late] - MISSION["z_ref"])
    heading = np.abs(result["rov.psi"][late] - MISSION["psi_ref"])
    return float(depth.max()), degrees(float(heading.max()))


def draw(results: Mapping[str, Trajectory], path: Path) -> None:
    """Depth, heading, track and commands, to an SVG or PNG file."""
    color = {role: light for role, (light, _) in PALETTE.items()}
    style = {
        "svg.hashsalt": "station keeping",
        "svg.fonttype": "none",
        "font.size": 9.5,
        "text.color": color["ink"],
        "axes.labelcolor": color["muted"],
        "axes.edgecolor": color["muted"],
        "axes.grid": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 10.5,
        "axes.titleweight": "bold",
        "grid.color": color["rule"],
        "grid.linewidth": 0.6,
        "xtick.color": color["muted"],
        "ytick.color": color["muted"],
        "legend.frameon": False,
        "legend.fontsize": 8.5,
    }
    with rc_context(style):
        figure = Figure(figsize=(8.6, 6.4), layout="constrained", facecolor=color["page"])
        axes: Sequence[Axes] = figure.subplots(2, 2).flat
        for parameters, result in results.items():
            line: Any = {"linewidth": 1.6} if parameters == DEFAULT else {"linewidth": 1.1, "linestyle": "--"}
            label = "Table 9" if parameters == DEFAULT else "α = β = 1"
            few = {name: values[::6] for name, values in result.items()}
            t = TIME[::6]
            axes[0].plot(t, few["rov.z"], color=color["blue"], label=label, **line)
            axes[1].plot(t, np.degrees(few["rov.psi"]), color=color["blue"], label=label, **line)
            axes[2].plot(few["rov.y"], few["rov.x"], color=color["blue"], label=label, **line)
            for name, role in (("u_l", "teal"), ("u_r", "violet"), ("u_t", "orange")):
                command = 100.0 * few[f"autopilot.{name}"]
                axes[3].plot(t, command, color=color[role], label=name if label == "Table 9" else None, **line)
        wanted: Any = {"color": color["orange"], "linewidth": 1.3, "linestyle": ":", "label": "reference model"}
        axes[0].plot(t, few["autopilot.z_d"], **wanted)
        axes[1].plot(t, np.degrees(few["autopilot.psi_d"]), **wanted)
        _finish(axes[0], "Depth", "time (s)", "z (m)")
        axes[0].invert_yaxis()
        _finish(axes[1], "Heading", "time (s)", "ψ (deg)")
        axes[1].set_yticks(np.arange(0.0, degrees(pi / 2) + 1.0, 15.0))
        _finish(axes[2], "Track", "east y (m)", "north x (m)")
        axes[2].plot(0.0, 0.0, "o", color=color["blue"], markersize=4.5)
        axes[2].set_aspect("equal", adjustable="datalim")
        _finish(axes[3], "Commands", "time (s)", "%")
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=150)


def _finish(ax: Axes, title: str, x: str, y: str) -> None:
    ax.set_title(title, loc="left")
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.legend()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m examples.station_keeping.run", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("build/station_keeping"),
                        help="where the files of the system go (default: %(default)s)")  # fmt: skip
    parser.add_argument("--figure", type=Path, metavar="FILE", help="SVG or PNG (default: in that folder)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
