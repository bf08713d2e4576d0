"""Kinds of texts and numbers in the tables of TOML files."""

import re
from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema


def printable(text: str) -> str:
    """Return the text if it has no control characters. Raises ValueError."""
    if control := re.search(r"[^\n\t -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", text):
        raise ValueError(f"must be without the control character {control[0]!a}")
    return text


def not_blank(text: str) -> str:
    """Return the text if it has more than white space. Raises ValueError."""
    if not text.strip():
        raise ValueError("must not be blank")
    return text


Text = Annotated[str, Field(min_length=1, max_length=10_000), AfterValidator(printable), AfterValidator(not_blank)]
Name = Annotated[
    str,
    Field(min_length=1, max_length=100, pattern=r"^[^\n\t]*$"),
    AfterValidator(printable),
    AfterValidator(not_blank),
]
Finite = Annotated[float, Field(allow_inf_nan=False)]


def symbol(text: str) -> str:
    """Return the text if it can be part of a variable's name. Raises ValueError."""
    if not re.fullmatch(r"[A-Za-z0-9_]{1,30}", text):
        raise ValueError("must be at most 30 letters, digits and underscores")
    return text


SYMBOL_SCHEMA = WithJsonSchema({"type": "string", "pattern": "^[A-Za-z0-9_]{1,30}$"})
Symbol = Annotated[str, AfterValidator(symbol), SYMBOL_SCHEMA]
"""A name that becomes part of the names of FMU variables."""
