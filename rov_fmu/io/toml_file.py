"""TOML files checked against the form that they must have; a line for every mistake."""

import json
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, create_model
from pydantic_core import ErrorDetails

from rov_fmu.io.file_kinds import check_keys
from rov_fmu.io.messages import MOST, FileError, brief, did_you_mean, lines_on, shown, similar
from rov_fmu.io.reading import read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class Strict(BaseModel):
    """A table of a TOML file: no keys but these, no number in quotes. Docstrings are what an editor shows."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


DOCUMENTED = ConfigDict(use_attribute_docstrings=True)


def table_of(name: str, base: type[Strict], fields: Mapping[str, Any], words: str | None = None) -> Any:
    """A table of fields that are computed: pydantic would look for their docstrings in every source above, at length.

    A class on top of it that has some of its own says so: `model_config = DOCUMENTED`.
    """
    quick = {"use_attribute_docstrings": False}
    return create_model(name, __base__=base, __doc__=words, __cls_kwargs__=quick, **fields)


_LARGEST = 20_000_000
"""Bytes of a TOML file."""
Checked = TypeVar("Checked", bound=Strict)
Toml = dict[str, Any]
_Place = tuple[int | str, ...]


def read_checked(path: Path, kind: str, model: type[Checked], failure: type[FileError], **context: object) -> Checked:
    """Read a TOML file of the given kind and form; `folder` and what else is given is the context. Raises `failure`."""
    data = read_toml(path, failure)
    check_keys(path, data, kind, failure)
    checked, problems = validate(data, model, folder=path.parent, **context)
    if checked is None:
        raise failure(*lines_on(path, problem_lines(problems, data, model)))
    return checked


def read_toml(path: Path, failure: type[FileError]) -> Toml:
    """Read a TOML file of any form. Raises `failure`."""
    text = read_text(path, failure, most=_LARGEST)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        found = re.search(r"at line (\d+)", str(error))
        line = text.split("\n")[int(found[1]) - 1].strip() if found else ""
        raise failure(f"{path}: not TOML: {brief(str(error))}{': ' if line else ''}{brief(line)}") from error


def validate(data: Toml, model: type[Checked], **context: object) -> tuple[Checked | None, list[ErrorDetails]]:
    """The data in the given form, or every problem with them."""
    try:
        return model.model_validate(data, context=context), []
    except ValidationError as error:
        return None, error.errors(include_url=False)


def as_tuple(value: object) -> object:
    """TOML knows lists, not tuples."""
    return tuple(value) if isinstance(value, list) else value


def folder_of(info: ValidationInfo) -> Path:
    """The folder of the file that is checked; the current one where what is checked is in no file."""
    return Path((info.context or {}).get("folder", ""))


# ---- Problems in words -----------------------------------------------------------------------------------------------

_REASONS = {
    "bool_type": "must be true or false",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "list_type": "must be a list",
    "string_type": "must be text in quotes",
    "tuple_type": "must be a list",
}
_OF_WHAT = re.compile("^(Input|String|List|Tuple|Dictionary) should ")
_LISTED = 10
"""Names that a line lists."""
_COMPARED = 100
"""Unknown keys of a table that a missing key is compared with."""


def problem_lines(problems: Sequence[ErrorDetails], data: Toml, model: type[Strict]) -> Iterator[str]:
    """A line for each problem with the file: key, value, what is allowed.

    After the first ten the lines are empty, for it takes long to find what each of many unknown keys may mean.
    """
    if not problems:  # the form takes long to write out
        return
    form, unknown = _Form(model), dict[_Place, list[_Place]]()
    for problem in problems:
        if problem["type"] == "extra_forbidden":
            unknown.setdefault(problem["loc"][:-1], []).append(problem["loc"])
    number = 0
    for problem in problems:
        place = problem["loc"]
        if number == MOST:
            yield ""
        elif problem["type"] != "missing" or not _is_misspelt(place, unknown.get(place[:-1], ()), form):
            number += 1
            yield _told(problem, data, form)


def join_names(names: Iterable[str]) -> str:
    """Names in a line, and neither endlessly many nor endless ones."""
    some = [name or repr("") for name in names]
    return brief(", ".join(some[:_LISTED]) + (", ..." if len(some) > _LISTED else ""), 200)


def key_line(key: str, reason: str, *value: object) -> str:
    """What is wrong with a key, or with its value."""
    return f"{brief(key)} = {shown(value[0])}: {reason}" if value else f"{brief(key)}: {reason}"


def entry_label(table: str, entries: Sequence[Any], number: int) -> str:
    """An entry of a list of tables by its name, or by its number from 1 where it has none of its own."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    name = names[number] if number < len(names) else None
    own = isinstance(name, str) and names.count(name) == 1
    return f"{table}.{name or repr('')}" if own else f"{table}#{number + 1}"


class _Form:
    """What a model says of each place in its file."""

    def __init__(self, model: type[Strict]) -> None:
        self._schema = model.model_json_schema()

    def at(self, place: _Place) -> dict[str, Any]:
        """The JSON schema of a place; an empty one where there is none."""
        found = self._schema
        for step in place:
            of_any = [found.get("additionalProperties"), *found.get("patternProperties", {}).values()]
            inner = [found.get("items") if isinstance(step, int) else found.get("properties", {}).get(step), *of_any]
            found = self._resolved(next((form for form in inner if isinstance(form, dict)), {}))
        return found

    def keys(self, place: _Place) -> list[str]:
        """Those that a table may have."""
        return [*self.at(place).get("properties", ())]

    def near(self, place: _Place) -> str | None:
        """The key that an unknown one probably means."""
        return next(iter(similar(str(place[-1]), self.keys(place[:-1]))), None)

    def written(self, place: _Place) -> str:
        """How a table, or a list of tables, is written."""
        form = self.at(place)
        key = brief(".".join(str(step) for step in place if isinstance(step, str)))
        if form.get("type") == "array" or isinstance(place[-1], int):
            return f"a list of tables: write [[{key}]]"
        if "value" not in form.get("properties", ()):
            return f"a table: write [{key}]"
        constants = {name: _constant(self.at((*place, name))) for name in form["required"]}
        pairs = (f"{name} = {json.dumps(value) if value else '...'}" for name, value in constants.items())
        return f"{{ {', '.join(pairs)} }}"

    def _resolved(self, form: dict[str, Any]) -> dict[str, Any]:
        """Without references, and without null, which TOML has not."""
        for choice in (*form.get("allOf", ()), *form.get("anyOf", ())):
            if choice != {"type": "null"}:
                return self._resolved(choice)
        if "$ref" in form:
            return self._resolved(self._schema["$defs"][form["$ref"].removeprefix("#/$defs/")])
        return form


def _constant(form: dict[str, Any]) -> Any:
    """The one value that a key may have."""
    one = form.get("enum", [form.get("const")])
    return one[0] if len(one) == 1 else None


def _is_misspelt(place: _Place, unknown: Sequence[_Place], form: _Form) -> bool:
    """Whether a missing key is misspelt: one of the unknown keys of its table must mean it."""
    return any(form.near(other) == place[-1] for other in unknown[:_COMPARED])


def _told(problem: ErrorDetails, data: Toml, form: _Form) -> str:
    place, value, kind = problem["loc"], problem["input"], problem["type"]
    key, of_table = brief(_key(place, data)), isinstance(value, dict)
    if kind == "missing" and isinstance(place[-1], int):  # of a list, for each entry that is not there
        place = place[:-1]
        entries, number = shown(_at(place, data)), form.at(place)["minItems"]
        return f"{brief(_key(place, data))} = {entries}: must have {number} entries"
    if kind == "missing":
        constant = _constant(form.at(place))
        return f"{key}: this key is missing" + (f": write {place[-1]} = {json.dumps(constant)}" if constant else "")
    if kind == "extra_forbidden":
        allowed = form.keys(place[:-1])
        hint = did_you_mean(str(place[-1]), allowed)
        only = "" if hint and len(allowed) > _LISTED else f", only {join_names(allowed)}"
        return f"{key}: there is no such key{only}{hint}"
    reason = _reason(problem, form)
    *above, last = place
    if isinstance(last, int) and not of_table and form.at(place).get("type") != "object":
        place, reason = tuple(above), f"entry {last + 1} {reason}"  # shown in its list
        value = _at(place, data)
        key = brief(_key(place, data))
    value = [*value] if isinstance(value, tuple) else value  # as TOML has it
    hidden = of_table and kind in ("value_error", "list_type")
    return f"{key}: {reason}" if hidden else f"{key} = {shown(value)}: {reason}"


def _reason(problem: ErrorDetails, form: _Form) -> str:
    """What is allowed."""
    kind, place = problem["type"], problem["loc"]
    here = form.at(place)
    if kind in ("model_type", "dict_type") or (kind == "list_type" and form.keys((*place, 0))):
        return f"must be {form.written(place)}"
    if kind in ("greater_than_equal", "less_than_equal") and "minimum" in here and "maximum" in here:
        return f"must be within {here['minimum']:g} ... {here['maximum']:g}"
    if kind == "literal_error":
        choices = [choice for choice in here.get("enum", ()) if isinstance(choice, str)]
        return problem["msg"].replace("Input should", "must") + did_you_mean(str(problem["input"]), choices)
    if kind == "float_type" and type(problem["input"]) is int:
        return "must be a number of at most 308 digits"
    if kind in _REASONS:
        return _REASONS[kind]
    return _OF_WHAT.sub("must ", problem["msg"].removeprefix("Value error, ")).replace(" after validation", "")


def _at(place: _Place, data: Any) -> Any:
    for step in place:
        data = data[step]
    return data


def _key(place: _Place, data: Any) -> str:
    """A place in the file; an entry of a list of tables by its name, or else by its number from 1."""
    words = ""
    for step in place:
        if step == "[key]":  # pydantic's word for a problem with a key itself
            continue
        words = entry_label(words, data, step) if isinstance(step, int) else f"{words}.{step or repr('')}"
        try:
            data = data[step]
        except (LookupError, TypeError):
            data = None
    return words.removeprefix(".")
