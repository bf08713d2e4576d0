"""What pages are made with: templates, and numbers as one writes them."""

import re
from collections.abc import Callable
from math import isfinite

from jinja2 import Environment, PackageLoader, StrictUndefined

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def environment(package: str, **filters: Callable[..., str]) -> Environment:
    """The templates of a package; what comes from files is escaped, and a name misspelt is an error."""
    templates = Environment(
        loader=PackageLoader(package), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    templates.filters |= filters
    return templates


def page(template: str, **content: object) -> str:
    """A page from a template of this package."""
    filters: dict[str, Callable[..., str]] = {
        "number": number,
        "percent": percent,
        "deviation": deviation,
        "unit": pretty_unit,
    }
    return environment("models", **filters).get_template(template).render(**content)


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
