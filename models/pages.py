"""What pages are made with: templates, numbers as one writes them, and a file written whole or not at all."""

import errno
import os
import re
import tempfile
from math import isfinite
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page(template: str, **content: object) -> str:
    """A page from its template; what comes from files is escaped."""
    environment = Environment(
        loader=PackageLoader(__package__),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "percent": percent, "deviation": deviation, "unit": pretty_unit}
    return environment.get_template(template).render(**content)


def number(value: float | None, digits: int = 4) -> str:
    """So many significant digits; a dash where there is no number."""
    if value is None or not isfinite(value):
        return "–"
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    text = f"{mantissa}·10{str(int(exponent)).translate(RAISED)}" if exponent else mantissa
    return text.replace("-", "−")


def percent(value: float, digits: int = 0) -> str:
    """A fraction; a dash where there is none."""
    return f"{100.0 * value:.{digits}f} %".replace("-", "−") if isfinite(value) else "–"


def deviation(value: float, measured: float) -> str:
    """Relative to the measured value, signed."""
    return f"{100.0 * (value / measured - 1.0):+.1f} %".replace("-", "−") if isfinite(value) else "–"


def pretty_unit(unit: str) -> str:
    """A unit as one writes it: N.m.s2/rad2 is N·m·s²/rad²."""
    if unit == "1":
        return "1"
    return re.sub(r"\d", lambda digit: digit[0].translate(RAISED), unit).replace(".", "·")


def write_whole(path: Path, text: str) -> None:
    """Put a text in place of whatever file was there. Raises OSError, about this path."""
    if path.is_dir():
        raise OSError(errno.EISDIR, "is a folder, not a file to write", str(path))
    if not path.parent.is_dir():
        raise OSError(errno.ENOENT, f"there is no folder {path.parent}", str(path))
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        temporary = Path(name)
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # as if it had been opened like any file
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        if temporary:
            temporary.unlink(missing_ok=True)
