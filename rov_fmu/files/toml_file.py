"""TOML files checked against the form that they must have; a line for every mistake."""

import sys
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo
from pydantic_core import ErrorDetails

from rov_fmu.files.messages import FileError, brief, shown
from rov_fmu.files.reading import read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class Strict(BaseModel):
    """A table of a TOML file: no keys but these, no number in quotes."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


Checked = TypeVar("Checked", bound=Strict)


def read_checked(path: Path, model: type[Checked], failure: type[FileError], **context: object) -> Checked:
    """Read a TOML file of the given form; `folder` and what else is given is the context. Raises `failure`."""
    text = read_text(path, failure)
    try:
        return model.model_validate(tomllib.loads(text), context={"folder": path.parent, **context})
    except ValidationError as error:
        raise failure(*(f"{path}: {_problem(problem)}" for problem in error.errors())) from error
    except (ValueError, RecursionError) as error:
        raise failure(f"{path}: not TOML: {brief(str(error))}") from error


def pair(value: object) -> object:
    """TOML knows lists, not tuples."""
    return tuple(value) if isinstance(value, list) else value


def beside(name: str, info: ValidationInfo) -> Path:
    """A path as seen from the file that names it."""
    return Path((info.context or {})["folder"], name)


def _problem(problem: ErrorDetails) -> str:
    """A problem of the file in one line: key, value, what is allowed."""
    key = brief(".".join(map(str, problem["loc"])))
    match problem["type"]:
        case "missing":
            return f"{key}: this key is missing"
        case "extra_forbidden":
            return f"{key}: there is no such key"
        case "model_type":
            return f"{key} = {shown(problem['input'])}: must be a table of keys and values"
    reason = problem["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    of_table = problem["type"] == "value_error" and isinstance(problem["input"], dict)
    return f"{key}: {reason}" if of_table else f"{key} = {shown(problem['input'])}: {reason}"
