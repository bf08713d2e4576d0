"""The paths of the package's own data files, and the paths that a user's file names.

A file that names another one may come from a stranger, so each name must lead to a place inside the folder of the file
that contains the name.
"""

import os
import re
from pathlib import Path, PureWindowsPath

_PACKAGE = Path(__file__).parent.parent
# An installed package holds its data files itself; a checkout has them at its top.
_TOP = _PACKAGE / "data" if (_PACKAGE / "data").is_dir() else _PACKAGE.parent

FMU_SRC = _TOP / "fmu_src"
"""The folder of the C sources, templates and scripts that go into an FMU."""
LICENSE = _TOP / "LICENSE"
"""The licence, which goes into an FMU."""
MODELS = _TOP / "models"
"""The folder of the vehicles that ship; each has a folder of its own."""
PREBUILT = _TOP / "prebuilt"
"""The folder of what a wheel has compiled for these vehicles. A checkout has no such folder."""
_DEVICE = re.compile(r"(CON|PRN|AUX|NUL|CONIN\$|CONOUT\$|(COM|LPT)[0-9¹²³]) *(\..*)?", re.IGNORECASE)
"""Names of devices in Windows. No file can have such a name there, whatever its extension."""
_INVISIBLE = "\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef"
"""The characters that Python takes as printable, and that have no width or no ink."""
_PART = re.compile(rf"(?!\.\.?$)[^<>:\"/\\|?*{_INVISIBLE}]*[^<>:\"/\\|?*{_INVISIBLE} .]")
_MOST_BYTES = 255
"""The longest part of a path in UTF-8."""


def is_portable(part: str) -> bool:
    """Return True if a part of a path names the same file or folder on every system, and shows what it is.

    Controls, marks that turn the direction of writing, and characters without a width would let it look like another.
    """
    is_short = len(part.encode(errors="replace")) <= _MOST_BYTES
    return is_short and part.isprintable() and bool(_PART.fullmatch(part)) and not _DEVICE.fullmatch(part)


def inside(folder: Path, name: str) -> Path:
    """Return the path for a name in a file of this folder. Raises ValueError with only the reason.

    A name means the same on every system: it is relative, and `/` separates its parts. After links are followed, the
    path must be inside the folder.
    """
    on_windows = PureWindowsPath(name)
    if not name or "\0" in name or "\\" in name or on_windows.drive or on_windows.root:
        raise ValueError("must be a relative path with / between its parts, without a drive, a backslash or a NUL")
    path = folder / name
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise ValueError("must lead to a place inside the folder of this file, after links are followed")
    return path


def inside_or_shipped(folder: Path, name: str) -> Path:
    """Return the path that `inside` gives for a name.

    If nothing is there, return the path of this name among the shipped vehicles.
    """
    path, shipped = inside(folder, name), inside(MODELS, name)
    return shipped if os.path.lexists(shipped) and not os.path.lexists(path) else path


def name_of(path: Path, folder: Path) -> str:
    """Return the name that `inside_or_shipped` turns into this path. Raises ValueError if there is none."""
    real = Path(os.path.realpath(path.parent), path.name)
    for top in (folder, MODELS):
        if real.is_relative_to(os.path.realpath(top)):
            name = real.relative_to(os.path.realpath(top)).as_posix()
            inside(top, name)
            return name
    raise ValueError(f"{path} is not inside the folder of this file")
