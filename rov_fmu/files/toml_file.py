"""TOML files checked against the form that they must have; a line for every mistake."""

import re
import sys
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo
from pydantic_core import ErrorDetails

from rov_fmu.files.messages import FileError, brief, shown
from rov_fmu.files.reading import read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class Strict(BaseModel):
    """A table of a TOML file: no keys but these, no number in quotes. Docstrings are what an editor shows."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


Checked = TypeVar("Checked", bound=Strict)
Toml = dict[str, Any]


def read_checked(path: Path, model: type[Checked], failure: type[FileError], **context: object) -> Checked:
    """Read a TOML file of the given form; `folder` and what else is given is the context. Raises `failure`."""
    data = read_toml(path, failure)
    checked, problems = check(data, model, folder=path.parent, **context)
    if checked is None:
        raise failure(*(f"{path}: {told(problem, data)}" for problem in problems))
    return checked


def read_toml(path: Path, failure: type[FileError]) -> Toml:
    """Read a TOML file of any form. Raises `failure`."""
    text = read_text(path, failure)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise failure(f"{path}: not TOML: {brief(str(error))}") from error


def check(data: Toml, model: type[Checked], **context: object) -> tuple[Checked | None, list[ErrorDetails]]:
    """The data in the given form, or every problem with them."""
    try:
        return model.model_validate(data, context=context), []
    except ValidationError as error:
        return None, error.errors()


def pair(value: object) -> object:
    """TOML knows lists, not tuples."""
    return tuple(value) if isinstance(value, list) else value


def beside(name: str, info: ValidationInfo) -> Path:
    """A path as seen from the file that names it."""
    return Path((info.context or {})["folder"], name)


_OF_WHAT = re.compile("^(Input|String|List|Tuple|Dictionary) should ")


def told(problem: ErrorDetails, data: Toml) -> str:
    """A problem of the file in one line: key, value, what is allowed."""
    key = brief(_key(problem["loc"], data))
    match problem["type"]:
        case "missing":
            return f"{key}: this key is missing"
        case "extra_forbidden":
            return f"{key}: there is no such key"
        case "model_type":
            return f"{key} = {shown(problem['input'])}: must be a table of keys and values"
    reason = _OF_WHAT.sub("must ", problem["msg"].removeprefix("Value error, ")).replace(" after validation", "")
    reason = reason.replace("a valid tuple", "a list").replace("a valid dictionary", "a table")
    of_table = problem["type"] == "value_error" and isinstance(problem["input"], dict)
    return f"{key}: {reason}" if of_table else f"{key} = {shown(problem['input'])}: {reason}"


def _key(place: tuple[int | str, ...], data: Any) -> str:
    """A place in the file; an entry of a list of tables by its name, or else by its number from 1."""
    words = ""
    for step in place:
        if step == "[key]":  # pydantic's word for a problem with a key itself
            continue
        try:
            data = data[step]
        except (LookupError, TypeError):
            data = None
        name = data.get("name") if isinstance(step, int) and isinstance(data, dict) else step
        words += "." + (name or "''") if isinstance(name, str) else f"#{int(step) + 1}"
    return words.removeprefix(".")
