"""Folders and files that nobody but this user can change, as code must be that is compiled or loaded from a cache.

The rules are those of OpenSSH for its own files (StrictModes). On Windows, nothing is checked: there, a cache lies in
the user's profile, and the system grants no other user access to it.
"""

import errno
import os
import stat
import sys
import tempfile
from contextlib import suppress
from pathlib import Path


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
