"""Plots as small PNG files: few colours, no metadata, the same bytes at every call."""

from io import BytesIO

from PIL.Image import Dither, Quantize, frombytes

from rov_fmu.report.plots.svg import Draw, saved

_DPI = 100
_COLOURS = 64
"""The number of colours: the flat colours of a plot, and those between them at edges."""


def png_file(draw: Draw, size: tuple[float, float], *, background: str, margin: float = 0.0) -> bytes:
    """Return a figure (size in inches) as PNG, independent of the user's settings of Matplotlib."""
    width, height = (round(inches * _DPI) for inches in size)
    inches = (width + 1e-6) / _DPI, (height + 1e-6) / _DPI  # Matplotlib cuts off a pixel that is not whole
    drawn = saved(draw, inches, background=background, margin=margin, format="rgba", dpi=_DPI)
    picture, file = frombytes("RGBA", (width, height), drawn), BytesIO()
    if background != "none":
        picture = picture.convert("RGB")  # nothing is transparent, and no rounded colour becomes so
    picture.quantize(_COLOURS, Quantize.FASTOCTREE, dither=Dither.NONE).save(file, "PNG", optimize=True)
    return file.getvalue()
