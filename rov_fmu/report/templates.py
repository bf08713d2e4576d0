"""What pages are made with: their templates, and numbers as one writes them."""

from math import isfinite, isnan
from pathlib import Path

from rov_fmu.io.templates import render
from rov_fmu.report.plots.svg import PALETTE

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page(template: str, **content: object) -> str:
    """A page from a template, with these formats as filters."""
    return render(
        template,
        Path(__file__).parent / "templates",
        number=number,
        text=text,
        unit=pretty_unit,
        palette=PALETTE,
        **content,
    )


def number(value: float | None, digits: int | None = None) -> str:
    """So many significant digits, or exactly where that is short; a dash where there is no number."""
    if value is None or not isfinite(value):
        return "–"
    is_short = digits is None and len(repr(value)) <= 9 and abs(value) < 1e5
    text = repr(value).removesuffix(".0") if is_short else f"{value:.{digits or 6}g}"
    mantissa, _, exponent = text.partition("e")
    if exponent:
        mantissa = {"1": "", "-1": "-"}.get(mantissa, f"{mantissa}·")
        text = f"{mantissa}10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", "−")


def text(value: float | None, form: str) -> str:
    """A number as the format has it; a dash where there is none."""
    if value is None or isnan(value):
        return "–"
    return format(value, form).replace("%", " %").replace("-", "−").replace("inf", "∞")


def pretty_unit(unit: str) -> str:
    """A unit as one writes it: N.m.s2/rad2 is N·m·s²/rad²."""
    return unit if unit == "1" else unit.translate(RAISED).replace(".", "·")
