"""Reading a vehicle's own pictures, which must have the format of their suffix."""

import warnings
from io import BytesIO
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from rov_fmu.io.messages import FileError
from rov_fmu.io.reading import read_bytes, root_of_xml

_LARGEST = 20_000_000
"""The largest picture that is read, in bytes."""


def read_png(path: Path) -> bytes:
    """Return the content of a PNG picture. Raises FileError."""
    content = read_bytes(path, most=_LARGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(BytesIO(content), formats=["PNG"]) as picture:
                picture.load()
    except UnidentifiedImageError as error:
        raise FileError(f"{path}: not a PNG picture") from error
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise FileError(f"{path}: not a PNG picture that can be read: {error}") from error
    return content


def read_svg(path: Path) -> bytes:
    """Return the content of an SVG picture. Raises FileError.

    It may contain scripts, so it must be shown as an image, in which browsers run no scripts.
    """
    content = read_bytes(path, most=_LARGEST)
    try:
        root = root_of_xml(content)
    except ValueError as error:
        raise FileError(f"{path}: not an SVG picture: {error}") from error
    if root.tag != "{http://www.w3.org/2000/svg}svg":
        raise FileError(f"{path}: not an SVG picture: its root is {root.tag} and not svg of http://www.w3.org/2000/svg")
    return content
