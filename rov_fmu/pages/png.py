"""Plots as small PNG files: sixteen colours, no metadata, the same bytes at every call."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from rov_fmu.pages.svg import Draw, saved

_DPI = 100
_COLOURS = 16
_DEPTH = 4
"""Bits of a pixel, which tell one of the colours."""


def png_file(draw: Draw, size: tuple[float, float], *, background: str, margin: float = 0.0) -> bytes:
    """A figure (size in inches) as PNG, whatever the user's Matplotlib is set to."""
    width, height = (round(inches * _DPI) for inches in size)
    inches = (width + 1e-6) / _DPI, (height + 1e-6) / _DPI  # for Matplotlib cuts off what is no whole pixel
    drawn = saved(draw, inches, background=background, margin=margin, format="rgba", dpi=_DPI)
    colours, which = _few(np.frombuffer(drawn, np.uint8).reshape(-1, 4))
    rows = np.pad(which.reshape(height, width), ((0, 0), (0, width % 2)))
    packed = rows[:, ::2] << _DEPTH | rows[:, 1::2]
    unfiltered = np.pad(packed, ((0, 0), (1, 0))).tobytes()
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", width, height, _DEPTH, 3, 0, 0, 0),
        b"PLTE": colours[:, :3].tobytes(),
        b"tRNS": colours[:, 3].tobytes(),
        b"IDAT": zlib.compress(unfiltered, 9),
        b"IEND": b"",
    }
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in chunks.items())


def _few(pixels: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The most frequent colours, and for each pixel the one that comes nearest."""
    all_colours, which, counts = np.unique(pixels, axis=0, return_inverse=True, return_counts=True)
    few = all_colours[np.argsort(-counts, kind="stable")[:_COLOURS]]
    apart = np.square(all_colours[:, None].astype(int) - few.astype(int)).sum(axis=2)
    return few, apart.argmin(axis=1).astype(np.uint8)[which.reshape(-1)]


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
