"""The paths of the package's own data files, those that a user's file names, and those that nobody else can change.

A file that names another one may come from a stranger, so each name must lead to a place inside the folder of the file
that contains the name.
"""

import errno
import os
import re
import stat
import sys
import tempfile
from contextlib import suppress
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


# ---- Files that nobody else can change -------------------------------------------------------------------------------
#
# Code that is compiled or loaded from a cache must be in such files. The rules are those of OpenSSH for its own files
# (StrictModes). On Windows, nothing is checked: there, a cache lies in the user's profile, and the system grants no
# other user access to it.


def own_folder(folder: Path) -> Path:
    """Return a folder with its links followed. It is made if it is missing.

    Raises OSError if it cannot be written, or if another user than root could change or exchange it: when that user
    owns or can write it or a folder above it. Of a folder above it with the sticky bit, such as /tmp, everybody may
    write other entries.
    """
    real = Path(os.path.realpath(folder))
    there = [place for place in (real, *real.parents) if place.exists()]
    if sys.platform != "win32":
        for place in there:
            found = place.stat()
            if found.st_uid != os.geteuid() and (place == real or found.st_uid != 0):
                raise PermissionError(errno.EPERM, f"{place} belongs to another user")
            if _others_write(place, found) and (place == real or not found.st_mode & stat.S_ISVTX):
                raise PermissionError(errno.EPERM, f"other users can write {place}")
    for place in reversed([real, *real.parents][: -len(there)]):
        place.mkdir(mode=0o700, exist_ok=True)
    with tempfile.TemporaryFile(dir=real):
        return real


def is_own_file(path: Path) -> bool:
    """Return True for a file that this user has written, and that nobody else can write."""
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode):
        return False
    return sys.platform == "win32" or (found.st_uid == os.geteuid() and not _others_write(path, found))


def _others_write(path: Path, found: os.stat_result) -> bool:
    """Return True if other users may write a file or a folder: all of them, or those of its group.

    The group of the same name as this user has no other members on systems where everybody has one, and where new files
    may be written by their group. An access control list grants more than the mode tells.
    """
    if sys.platform == "win32" or not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return False
    import grp
    import pwd

    with suppress(KeyError):
        user, group = pwd.getpwuid(os.geteuid()), grp.getgrgid(found.st_gid)
        has_list = sys.platform == "linux" and "system.posix_acl_access" in os.listxattr(path)
        is_private = user.pw_uid != 0 and group.gr_name == user.pw_name and {*group.gr_mem} <= {user.pw_name}
        return bool(found.st_mode & stat.S_IWOTH) or has_list or not is_private
    return True
