"""The vehicles that ship, by name."""

from pathlib import Path

from rov_fmu.files.messages import FileError
from rov_fmu.files.places import MODELS

SHIPPED = {folder.name: folder / f"{folder.name}.toml" for folder in sorted(MODELS.iterdir()) if folder.is_dir()}
"""Name to vehicle file."""
VIDEORAY = SHIPPED["videoray"]


def find_vehicle(given: str | Path) -> Path:
    """The vehicle file at a path, or of a vehicle that ships. Raises FileError."""
    path, name = Path(given), str(given)
    if name in SHIPPED and not (path.exists() and not path.is_dir()):
        return SHIPPED[name]
    if name.isidentifier() and not path.exists():
        raise FileError(f"{name}: there is no such file, and no vehicle of this name ships, only {', '.join(SHIPPED)}")
    return path
