"""The layout of the paper's vehicle: surge, heave and yaw, a pair of rear thrusters and one on top."""

from rov_fmu.model.layout import HEAVE, SURGE, YAW, Curve, Layout, Thruster, VehicleAxis

PAPER = Layout(
    axes=(VehicleAxis(SURGE), VehicleAxis(HEAVE), VehicleAxis(YAW)),
    curves=(
        Curve("rear", together=2, description="rear pair", equation="(9)"),
        Curve("top", description="top thruster", equation="(10)"),
    ),
    thrusters=(
        Thruster("l", "rear", (1.0, 0.0, 0.0), arm=1, description="left thruster"),
        Thruster("r", "rear", (1.0, 0.0, 0.0), arm=-1, description="right thruster"),
        Thruster("t", "top", (0.0, 0.0, 1.0), description="top thruster"),
    ),
)
_SOURCE = "the form of the paper's vehicle: two rear thrusters ahead, one down"
PAPER_SOURCES = {thruster.name: {"direction": _SOURCE} for thruster in PAPER.thrusters}
"""The sources of the thrusters' directions, by the name of the thruster."""
