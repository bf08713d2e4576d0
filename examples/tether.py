"""Draw a tether from the motion of a system, from the south: python -m examples.tether MOTION.csv PICTURE.svg

The tether is the component `tether`, and the vehicle the component `rov`.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rov_fmu.io.output import Output, sealed, write_whole
from rov_fmu.report.plots.svg import LIGHT, name_axes, svg_file

MOMENTS = 6


def draw(motion: Path, picture: Path) -> None:
    """Draw the tether at some moments, and its tension over time."""
    rows = np.genfromtxt(motion, delimiter=",", names=True, deletechars="")
    places = sum(name.startswith("tether.z_") and name[9:].isdigit() for name in rows.dtype.names or ())

    def drawn(figure: Figure) -> None:
        side, tension = figure.subplots(1, 2)
        for n, row in enumerate(rows[np.linspace(1, len(rows) - 1, MOMENTS).astype(int)]):
            y, z = ([row[f"tether.{axis}_{k}"] for k in range(places)] for axis in "yz")
            look = {"color": LIGHT["blue"], "alpha": 0.3 + 0.7 * n / (MOMENTS - 1)}
            side.plot(y, z, linewidth=1.3, label=f"{row['time']:.0f} s", **look)
            side.plot(row["rov.y"], row["rov.z"], "s", markersize=5, **look)
        side.invert_yaxis()
        side.set_aspect("equal", adjustable="datalim")
        name_axes(side, "depth", "m", "way to the east (m)")
        side.legend()
        for end, role in (("top", "teal"), ("bottom", "orange")):
            tension.plot(rows["time"], rows[f"tether.tension_{end}"], color=LIGHT[role], linewidth=1.3, label=end)
        name_axes(tension, "tension", "N", "time (s)")
        tension.legend()

    svg = svg_file(drawn, (8.6, 3.4), salt="tether", background=LIGHT["page"])
    write_whole(Output(picture, sealed(svg).encode()), force=True)


if __name__ == "__main__":
    draw(*map(Path, sys.argv[1:3]))
