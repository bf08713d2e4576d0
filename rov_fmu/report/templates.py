"""Render pages from templates, with filters that format numbers and units for readers."""

import base64
import hashlib
import os
import re
from dataclasses import dataclass
from datetime import date, datetime, timezone
from math import isfinite, isnan
from pathlib import Path

from markupsafe import Markup

from rov_fmu.io import numbers
from rov_fmu.io.messages import capitalized
from rov_fmu.io.program import program
from rov_fmu.io.templates import render
from rov_fmu.report import console
from rov_fmu.report.palette import PALETTE

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""The translation of digits to superscripts."""
_TEMPLATES = Path(__file__).parent / "templates"
_FOR_READERS = re.compile(r"(?m)^ *(//.*|/\*\*([^*]|\*(?!/))*\*/)\n|/\*\* [^*\n]* \*/ |^ +|^\n| // [^`\n]*$")
"""Comments, types and indents are for readers of a script. They are a third of it, and are left out of pages."""


@dataclass(frozen=True)
class Script:
    """A script in a page, and the directive of the page's content security policy that allows it."""

    text: Markup
    policy: str


def inline_script(*names: str, folder: Path = _TEMPLATES) -> Script:
    """Return scripts, one after the other, without what only readers of their source need."""
    text = _FOR_READERS.sub("", "".join((folder / name).read_text(encoding="utf-8") for name in names))
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return Script(Markup(text), f"; script-src 'sha256-{digest}'")


def today() -> date:
    """Return today's date (UTC), or the date of SOURCE_DATE_EPOCH, which makes builds reproducible."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(epoch), timezone.utc) if epoch.isdecimal() else datetime.now(timezone.utc)
    return now.date()


def page(template: str, **content: object) -> str:
    """Return a page made from a template; the functions of this module are its filters.

    The same content gives the same page on the same day.
    """
    return render(
        template,
        _TEMPLATES,
        made=today(),
        program=program(),
        number=number,
        text=number_text,
        unit=pretty_unit,
        with_interval=shown_interval,
        sentence=sentence,
        readable=readable,
        palette=PALETTE,
        **content,
    )


def number(value: float | None, digits: int | None = None) -> str:
    """Return a number for readers, or a dash for None, NaN and infinity.

    With `digits`, the number has this many significant digits. Without it, the exact number is written if it is short,
    and otherwise 6 digits.
    """
    if value is None or not isfinite(value):
        return "–"
    value += 0.0  # makes 0 of -0
    is_short = digits is None and len(repr(value)) <= 9 and abs(value) < 1e5
    return _with_signs(repr(value).removesuffix(".0") if is_short else f"{value:.{digits or 6}g}")


def shown_interval(value: float, interval: tuple[float, float] | None) -> list[str]:
    """Return a value and the ends of its interval for readers, with digits that suit the interval."""
    texts = numbers.with_interval(value, interval)
    return [_with_signs(number_text).replace("inf", "∞").replace("nan", "–") for number_text in texts]


def _with_signs(text: str) -> str:
    """Return a number with a typographic minus sign, and with a power of ten instead of an exponent."""
    mantissa, _, exponent = text.partition("e")
    if exponent:
        mantissa = {"1": "", "-1": "-"}.get(mantissa, f"{mantissa}·")
        text = f"{mantissa}10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", "−")


def number_text(value: float | None, form: str) -> str:
    """Return a number in a format with typographic signs, or a dash for None and NaN."""
    if value is None or isnan(value):
        return "–"
    return console.text(value, form).replace("%", " %").replace("-", "−").replace("inf", "∞")


def sentence(text: str) -> str:
    """Return a text with a capital first letter, except where it begins with the name of a file."""
    text = readable(text)
    head, colon, _ = text.partition(":")
    start = head if colon else head.partition(" ")[0]
    return text if re.search(r"\.[A-Za-z]", start) else capitalized(text)


def readable(text: str) -> str:
    """Return a sentence with minus signs, spaces that hold lines together before %, µs for us, and ° for deg."""
    text = re.sub(r"(?<=[\s(])-(?=\d)", "−", text)
    text = re.sub(r"(?<=\d)%(?=[\s,.;)]|$)", "\xa0%", text)
    return re.sub(r"(?<=\d )us\b", "µs", re.sub(r"(?<=\d )deg\b", "°", text))


def pretty_unit(unit: str) -> str:
    """Return a unit for readers: N.m.s2/rad2 becomes N·m·s²/rad²."""
    return {"1": "1", "us": "µs", "deg": "°", "deg/s": "°/s"}.get(unit) or unit.translate(RAISED).replace(".", "·")


def panel_title(quantity: str, unit: str) -> str:
    """Return the title of a panel: the quantity in words, and its unit if there is one."""
    return with_unit(capitalized(quantity), unit)


def with_unit(name: str, unit: str) -> str:
    """Return a name with its unit; either of them may be missing."""
    words = "" if unit == "1" else pretty_unit(unit)
    return f"{name} ({words})" if name and words else name or words
