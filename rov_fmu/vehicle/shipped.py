"""The vehicles that ship, by name."""

from pathlib import Path

from rov_fmu.io.file_kinds import VEHICLE_FILE, check_suffix
from rov_fmu.io.messages import NO_FILE, FileError, did_you_mean, shown
from rov_fmu.io.paths import MODELS

SHIPPED = {folder.name: folder / f"{folder.name}.toml" for folder in sorted(MODELS.iterdir()) if folder.is_dir()}
"""The vehicle files that ship, by name."""
VIDEORAY = SHIPPED["videoray"]


def shipped_name(path: Path) -> str:
    """Return the name of the shipped vehicle with this file; an empty text if there is none."""
    return next((name for name, own in SHIPPED.items() if own == path), "")


def find_vehicle(given: str | Path) -> Path:
    """Return the vehicle file at a path, or of a shipped vehicle with this name. Raises FileError.

    - `given`: a path or a name. A file with the name of a vehicle that ships comes first.

        find_vehicle("bluerov2")
    """
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


def named_in(path: Path, key: str, given: str, failure: type[FileError]) -> Path:
    """Return the vehicle file that a key of a plan at a path names: one in its folder, or one that ships.

    Raises `failure`.
    """
    beside = path.parent / given
    if beside.is_file():
        return beside
    if given not in SHIPPED:
        ships = ", ".join(SHIPPED)
        reason = f"there is no such file beside the plan, and no vehicle of this name ships, only {ships}"
        raise failure(f"{path}: {key} = {shown(given)}: {reason}{did_you_mean(given, SHIPPED)}")
    return SHIPPED[given]
