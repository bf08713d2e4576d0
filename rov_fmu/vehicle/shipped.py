"""The vehicles that ship, by name, and the layout of the paper's vehicle."""

from pathlib import Path

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.equation.layout import Curve, Direction, Layout, Thruster, VehicleAxis
from rov_fmu.io.file_kinds import VEHICLE_FILE, check_suffix
from rov_fmu.io.messages import NO_FILE, FileError, did_you_mean
from rov_fmu.io.paths import MODELS

SHIPPED = {folder.name: folder / f"{folder.name}.toml" for folder in sorted(MODELS.iterdir()) if folder.is_dir()}
"""The vehicle files that ship, by name."""
VIDEORAY = SHIPPED["videoray"]

_FORM = "the form of the paper's vehicle: two rear thrusters ahead, one down"
_AHEAD, _DOWN = (Direction(value=along, source=_FORM) for along in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
PAPER = Layout(
    axes=(VehicleAxis(SURGE), VehicleAxis(HEAVE), VehicleAxis(YAW)),
    curves=(
        Curve("rear", together=2, description="rear pair", equation="(9)"),
        Curve("top", description="top thruster", equation="(10)"),
    ),
    thrusters=(
        Thruster(name="l", description="left thruster", direction=_AHEAD, curve="rear", arm="port"),
        Thruster(name="r", description="right thruster", direction=_AHEAD, curve="rear", arm="starboard"),
        Thruster(name="t", description="top thruster", direction=_DOWN, curve="top"),
    ),
)
"""The layout of the paper's vehicle: surge, heave and yaw, a pair of rear thrusters and one on top."""


def find_vehicle(given: str | Path) -> Path:
    """Return the vehicle file at a path, or of a shipped vehicle with this name. Raises FileError."""
    path, name = Path(given), str(given)
    if name in SHIPPED and (path.is_dir() or not path.exists()):
        return SHIPPED[name]
    if not name:
        raise FileError("VEHICLE is empty: it must be the path of a vehicle file, or the name of a vehicle that ships")
    if path.is_dir():
        raise FileError(f"{path}: cannot be read: is a folder, and must be {VEHICLE_FILE}")
    check_suffix(path, VEHICLE_FILE)
    if not path.exists():
        is_bare_name = not path.suffix and path.parent == Path()
        ships = f", and no vehicle of this name ships, only {', '.join(SHIPPED)}" if is_bare_name else ""
        beside = [str(file) for file in sorted(path.parent.glob("*.toml"))]
        raise FileError(f"{name}: {NO_FILE}{ships}{did_you_mean(name, [*SHIPPED, *beside])}")
    return path
