"""Unpack an FMU that may come from anyone: the files stay in their folder, and their size is limited."""

import os
import stat
import zipfile
from pathlib import Path
from typing import IO, Any

from rov_fmu.io.messages import FileError, brief, shown

_MOST_BYTES = 2_000_000_000
"""The size of all files together."""
_MOST_RATIO = 100
"""The size of all files together, relative to that of the archive, if it is above _SMALL."""
_SMALL = 100_000_000
"""Bytes that an archive may unpack to, however well it is compressed."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The compression that FMI allows. Python takes memory without limit for other methods."""


def unpack_fmu(archive: Path | IO[bytes], fmu: Path, folder: Path) -> Any:
    """Unpack an FMU into a folder, and return FMPy's description of it.

    Raises FileError, which names the FMU by the path `fmu`, if it is damaged, if a file would lie outside the folder or
    is a link, or if the files take too much space.
    """
    import fmpy

    try:
        with zipfile.ZipFile(archive) as zipped:
            if reason := _refusal(zipped):
                raise FileError(f"{fmu}: {reason}")
            zipped.extractall(folder)
    except FileError:
        raise
    except OSError as error:
        where = f": {os.path.relpath(error.filename, folder)}" if error.filename else ""
        raise FileError(f"{fmu}: cannot be unpacked: {error.strerror or error}{where}") from error
    except Exception as error:  # zipfile raises many kinds on damaged or encrypted archives
        raise FileError(f"{fmu}: is not an FMU, or is damaged: {brief(str(error))}") from error
    try:
        return fmpy.read_model_description(str(folder), validate=False)
    except Exception as error:  # what FMPy raises
        reason = str(error).replace(f"{folder}{os.sep}", "")
        raise FileError(f"{fmu}: is not an FMU that FMPy can read: {brief(reason)}") from error


def _refusal(zipped: zipfile.ZipFile) -> str:
    """Return the reason why an archive is refused, or an empty text if it is not."""
    members = zipped.infolist()
    for member in members:
        name = member.orig_filename
        if name.startswith("/") or ".." in name.split("/") or any(c in name for c in "\\:\0"):
            return f"member {shown(name)}: a path in an FMU must be relative, with forward slashes and without .."
        if stat.S_IFMT(member.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR):
            return f"member {shown(name)}: is a link or a special file; an FMU must have files and folders only"
        if member.compress_type not in _METHODS:
            return f"member {shown(name)}: must be stored or deflated, the compression that FMI allows"
    total = sum(member.file_size for member in members)
    packed = zipped.start_dir
    if total > _MOST_BYTES:
        return f"would take {total / 1e9:.3g} GB unpacked; at most {_MOST_BYTES / 1e9:g} GB are allowed"
    if total > max(_SMALL, _MOST_RATIO * packed):
        return (
            f"would take {total / 1e6:.3g} MB unpacked, {total / packed:.0f} times the size of the archive; "
            f"above {_SMALL / 1e6:g} MB at most {_MOST_RATIO} times are allowed"
        )
    return ""
