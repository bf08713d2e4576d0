"""Reading TOML files and checking them against a pydantic model; each mistake gives one line."""

import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails
from typing_extensions import Self

from rov_fmu.io.file_kinds import check_keys
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import MOST, FileError, brief, did_you_mean, lines_on, listed, only, shown, similar
from rov_fmu.io.paths import inside
from rov_fmu.io.reading import read_bytes, text_of

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class Strict(BaseModel):
    """A table of a TOML file. It may have no other keys, and no number in quotes. Editors show its docstrings."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True, defer_build=True)

    one_of: ClassVar[Sequence[str]] = ()
    """Keys of which a table has exactly one."""

    @model_validator(mode="after")
    def _has_one(self) -> Self:
        if self.one_of and sum(getattr(self, key) is not None for key in self.one_of) != 1:
            raise ValueError(f"must have one of {listed(self.one_of, 'or')}")
        return self

    @staticmethod
    def hint(_key: str, /) -> str:
        """Return the end of the message about an unknown key: its other name or place. It is empty if there is none."""
        return ""


DOCUMENTED = ConfigDict(use_attribute_docstrings=True)
"""The `model_config` of a class that adds keys with docstrings to a base made by `table_model`."""


def table_model(name: str, base: type[Strict], fields: Mapping[str, Any], words: str | None = None) -> Any:
    """Return a table whose fields are computed.

    They have no docstrings in any source file, and pydantic would take long to search for them.
    """
    settings = {"use_attribute_docstrings": False}
    return create_model(name, __base__=base, __doc__=words, __cls_kwargs__=settings, **fields)


LARGEST = 2_000_000
"""The largest TOML file that is read, in bytes. All correlations of 200 coefficients take less."""
_DEEPEST = 20
"""The most parts of a dotted key. The time and the memory of the parsers grow with their square."""
_MOST_SIGNS = 200_000
"""The most keys, parts of keys and values, for which the parsers take up to 1 kB each."""
Checked = TypeVar("Checked", bound=Strict)
Toml = dict[str, Any]
_Keys = tuple[int | str, ...]
_DECIMAL_COMMA = re.compile(r"^[^#\[]*=\s*[-+]?\d+,\d")
"""The beginning of a line that has a number with a decimal comma, outside a list."""


def read_checked(path: Path, kind: str, model: type[Checked], failure: type[FileError], **context: object) -> Checked:
    """Read a TOML file and check it against a model, with `folder` and `context` as context. Raises `failure`."""
    data = read_toml(path, failure)
    check_keys(path, data, kind, failure)
    checked, problems = validate(data, model, folder=path.parent, **context)
    if checked is None:
        raise failure(*lines_on(path, problem_lines(problems, data, model)))
    return checked


def read_toml(path: Path, failure: type[FileError]) -> Toml:
    """Read any TOML file. Raises `failure`."""
    return parse_toml(path, read_bytes(path, failure, most=LARGEST), failure)


def toml_text(path: Path, content: bytes, failure: type[FileError]) -> str:
    """Return the content of a TOML file as text that a parser may be given. Raises `failure` if it would exhaust one.

    A stranger may have written the file.
    """
    text = text_of(path, content, failure)
    outside = '""'.join(_outside_strings(text))
    for key in re.finditer(r"[^=,\[\]{}\n]+", outside):
        if (parts := key[0].count(".") + 1) > _DEEPEST:
            raise failure(f"{path}: {brief(key[0].strip(), 40)}: has {parts} parts: a key has at most {_DEEPEST}")
    if (signs := len(re.findall(r"[=,.\[{]", outside))) > _MOST_SIGNS:
        raise failure(f"{path}: has {signs} keys, dots and values: at most {_MOST_SIGNS} are read")
    return text


_STRING = re.compile("\"\"\"|'''|[\"'#]")
_ENDS = {
    start: re.compile(end, re.DOTALL)
    for start, end in {'"""': r'\\.|"{3,5}', "'''": "'{3,5}", '"': r'\\.|["\n]', "'": "['\n]", "#": "\n"}.items()
}
"""What ends a string or a comment, by what begins it, or an escaped character in it."""


def _outside_strings(text: str) -> Iterator[str]:
    """Yield the parts of a TOML file between its strings and comments."""
    offset = 0
    while start := _STRING.search(text, offset):
        yield text[offset : start.start()]
        ends = _ENDS[start[0]].finditer(text, start.end())
        end = next((one for one in ends if not one[0].startswith("\\")), None)
        offset = len(text) if end is None else end.end() - (end[0] == "\n")
    yield text[offset:]


def parse_toml(path: Path, content: bytes, failure: type[FileError]) -> Toml:
    """Return the content of a TOML file, which was read from a path. Raises `failure`."""
    text = toml_text(path, content, failure)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        position = re.search(r"at line (\d+)", str(error))
        line = text.split("\n")[int(position[1]) - 1].strip() if position else ""
        hint = " (a number needs a decimal point)" if _DECIMAL_COMMA.search(line) else ""
        raise failure(f"{path}: not TOML: {brief(str(error))}{': ' if line else ''}{brief(line)}{hint}") from error


def validate(data: Toml, model: type[Checked], **context: object) -> tuple[Checked | None, list[ErrorDetails]]:
    """Return the data as a model, or None and every problem with them."""
    try:
        return model.model_validate(data, context=context), []
    except ValidationError as error:
        return None, error.errors(include_url=False)


def folder_of(info: ValidationInfo) -> Path:
    """Return the folder of the file that is checked, or the current folder for data from no file."""
    return Path((info.context or {}).get("folder", ""))


# ---- Kinds of values -------------------------------------------------------------------------------------------------


AS_TUPLE = Field(strict=False)
"""An array of TOML becomes a tuple."""


TEXT_SCHEMA = WithJsonSchema({"type": "string"})
"""What editors are told of a text that becomes something else."""


def numbers_schema(count: int) -> WithJsonSchema:
    """Return what editors are told of a list of so many numbers."""
    return WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count})


def printable(text: str) -> str:
    """Return the text if it has no control characters. Raises ValueError."""
    if control := re.search(r"[^\n\t -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", text):
        raise ValueError(f"must be without the control character {control[0]!a}")
    return text


def rule(words: str, holds: Callable[[Any], object]) -> AfterValidator:
    """Return a validator that raises ValueError with these words about a value that does not keep a rule."""

    def checked(given: Any) -> Any:
        if not holds(given):
            raise ValueError(words)
        return given

    return AfterValidator(checked)


NOT_BLANK = rule("must not be blank", str.strip)
Text = Annotated[str, Field(min_length=1, max_length=10_000), AfterValidator(printable), NOT_BLANK]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\n\t]*$"), AfterValidator(printable), NOT_BLANK]
Finite = Annotated[float, Field(allow_inf_nan=False)]
SYMBOL = rule("must be at most 30 letters, digits and underscores", re.compile("[A-Za-z0-9_]{1,30}").fullmatch)
SYMBOL_SCHEMA = WithJsonSchema({"type": "string", "pattern": "^[A-Za-z0-9_]{1,30}$"})
Symbol = Annotated[str, SYMBOL, SYMBOL_SCHEMA]
"""A name that becomes part of the names of FMU variables."""


def _beside(name: str, info: ValidationInfo) -> str:
    inside(folder_of(info), name)
    return name


Beside = Annotated[str, AfterValidator(_beside)]
"""A file in the folder of the TOML file, or in a folder inside it."""


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
_PYDANTIC_START = re.compile("^(Input|String|List|Tuple|Dictionary) should ")
_LISTED = 10
"""The number of names that a line lists."""
_COMPARED = 100
"""The number of unknown keys of a table that are compared with a missing key, and of entries with the same mistake."""


def problem_lines(problems: Sequence[ErrorDetails], data: Toml, model: type[Strict]) -> Iterator[str]:
    """Yield a line for each problem with the file: key, value, what is allowed.

    A mistake that several entries of a list of tables repeat gives one line. After the first ten the lines are empty,
    because it takes long to find the most similar key for many unknown ones.
    """
    extra = [problem["loc"] for problem in problems if problem["type"] == "extra_forbidden"]
    unknown = grouped((keys[:-1], keys) for keys in extra)  # those of each table
    number = 0
    for some in grouped((_mistake(problem), problem) for problem in problems).values():
        if number == MOST:
            yield ""
            continue
        real = [p for p in some[:_COMPARED] if not _is_misspelt(p, unknown.get(p["loc"][:-1], ()), model)]
        if real:
            number += 1
            others = len(real) - 1 + len(some[_COMPARED:])
            more = f" (and in {others} more {'entry' if others == 1 else 'entries'})" if others else ""
            yield _problem_line(real[0], data, model) + more


def join_names(names: Iterable[str]) -> str:
    """Return the first names on one line of limited length."""
    some = [name or repr("") for name in names]
    return brief(", ".join(some[:_LISTED]) + (", ..." if len(some) > _LISTED else ""), 200)


def key_line(key: str, reason: str, *value: object) -> str:
    """Return a line that says what is wrong with a key, or with its value."""
    return f"{brief(key)} = {shown(value[0])}: {reason}" if value else f"{brief(key)}: {reason}"


def entry_label(table: str, entries: Sequence[Any], number: int) -> str:
    """Return a label for an entry of a list of tables: its name if no other entry has it, or its number from 1."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    name = names[number] if number < len(names) else None
    is_unique = isinstance(name, str) and names.count(name) == 1
    return f"{table}.{name or repr('')}" if is_unique else f"{table}#{number + 1}"


def _declared(model: type[Strict], keys: _Keys) -> Any:
    """Return the type that a model declares for a path of keys in the file, such as a table, a list or a Literal."""
    kind: Any = model
    for step in keys:
        if _is_table(kind):
            field = _fields(kind).get(str(step))
            others = kind.__annotations__.get("__pydantic_extra__", dict[str, Any])
            kind = field.annotation if field else get_args(others)[1]
        elif inside := get_args(kind):
            kind = inside[1] if get_origin(kind) is dict else inside[0]
        while get_origin(kind) in (Annotated, Union, UnionType):
            kind = next(choice for choice in get_args(kind) if choice is not NoneType)
    return kind


def _is_table(kind: Any) -> bool:
    """Return True for a type whose keys are declared."""
    is_class = isinstance(kind, type) and get_origin(kind) is None  # Python 3.10 takes list[str] for a class, too
    return is_class and issubclass(kind, Strict)


def _fields(kind: Any) -> dict[str, FieldInfo]:
    """Return the keys of a table as the file has them; none if the type is no table."""
    fields = kind.model_fields if _is_table(kind) else {}
    return {field.alias or name: field for name, field in fields.items()}


def _constant(kind: Any) -> Any:
    """Return the only value that a key may have, or None if it may have several."""
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    return choices[0] if len(choices) == 1 else None


def _syntax(model: type[Strict], keys: _Keys) -> str:
    """Return how to write the table, or the list of tables, at a path of keys."""
    kind = _declared(model, keys)
    key = brief(".".join(str(step) for step in keys if isinstance(step, str)))
    if get_origin(kind) in (list, tuple) or isinstance(keys[-1], int):
        return f"a list of tables: write [[{key}]]"
    if "value" not in _fields(kind):
        return f"a table: write [{key}]"
    needed = (name for name, field in _fields(kind).items() if field.is_required())
    constants = {name: _constant(_declared(kind, (name,))) for name in needed}
    pairs = (f"{name} = {json.dumps(value) if value else '...'}" for name, value in constants.items())
    return f"{{ {', '.join(pairs)} }}"


def _mistake(problem: ErrorDetails) -> tuple[object, ...]:
    """Return a key for a problem. It is the same for the same mistake in two entries of a list of tables."""
    key = tuple(step for step in problem["loc"][:-1] if isinstance(step, str))
    value = "" if problem["type"] in ("missing", "extra_forbidden") else shown(problem["input"])
    last = [step for step in problem["loc"][-1:] if isinstance(step, str)]
    return problem["type"], key, *last, problem["msg"], value


def _is_misspelt(problem: ErrorDetails, unknown: Sequence[_Keys], model: type[Strict]) -> bool:
    """Return True when a key is missing, and one of the unknown keys of its table is probably this key, misspelt."""
    if problem["type"] != "missing" or not unknown:
        return False
    *above, key = problem["loc"]
    allowed = _fields(_declared(model, tuple(above)))
    return any(similar(str(keys[-1]), allowed) == [key] for keys in unknown[:_COMPARED])


def _problem_line(problem: ErrorDetails, data: Toml, model: type[Strict]) -> str:
    """Return the line for one problem."""
    keys, kind, value = problem["loc"], problem["type"], problem["input"]
    if not keys:  # a rule about the whole file
        return _reason(problem, model)
    *above, last = keys
    is_table = isinstance(value, dict)
    key = brief(_key(keys, data))
    if isinstance(last, int) and (kind == "missing" or not (is_table or _is_table(_declared(model, keys)))):
        return _entry_line(problem, last, data, model)
    if kind == "missing":
        constant = _constant(_declared(model, keys))
        return f"{key}: this key is missing" + (f": write {last} = {json.dumps(constant)}" if constant else "")
    if kind == "extra_forbidden":
        allowed = _fields(_declared(model, tuple(above)))
        similar_key = did_you_mean(str(last), allowed) if len(allowed) > _LISTED else ""
        hint = model.hint(str(last)) or similar_key or only(str(last), allowed, join_names(allowed))
        return f"{key}: there is no such key{hint}"
    reason = _reason(problem, model)
    if is_table and kind in ("value_error", "list_type"):
        return f"{key}: {reason}"
    return f"{key} = {shown([*value] if isinstance(value, tuple) else value)}: {reason}"


def _entry_line(problem: ErrorDetails, number: int, data: Toml, model: type[Strict]) -> str:
    """Return the line for a problem with an entry of a list that is no table. It shows the whole list."""
    *above, _ = problem["loc"]
    whole: Any = data
    for step in above:
        whole = whole[step]
    entries = len(get_args(_declared(model, tuple(above))))
    is_missing = problem["type"] == "missing"
    reason = f"must have {entries} entries" if is_missing else f"entry {number + 1} {_reason(problem, model)}"
    return f"{brief(_key(tuple(above), data))} = {shown(whole)}: {reason}"


def _reason(problem: ErrorDetails, model: type[Strict]) -> str:
    """Return what is allowed where the problem is."""
    kind, keys = problem["type"], problem["loc"]
    if kind in ("model_type", "dict_type") or (kind == "list_type" and _is_table(_declared(model, (*keys, 0)))):
        return f"must be {_syntax(model, keys)}"
    if kind == "literal_error":
        choices = map(str, get_args(_declared(model, keys)))
        return problem["msg"].replace("Input should", "must") + did_you_mean(str(problem["input"]), choices)
    if kind == "float_type" and type(problem["input"]) is int:
        return "must be a number of at most 308 digits"
    if kind in _REASONS:
        return _REASONS[kind]
    message = problem["msg"].removeprefix("Value error, ")
    return _PYDANTIC_START.sub("must ", message).replace(" after validation", "")


def _key(keys: _Keys, data: Any) -> str:
    """Return a path of keys in the file as a dotted key; an entry of a list of tables has its name or its number."""
    key = ""
    for step in keys:
        if step == "[key]":  # pydantic adds this step if the problem is with the key itself
            continue
        key = entry_label(key, data, step) if isinstance(step, int) else f"{key}.{step or repr('')}"
        try:
            data = data[step]
        except (LookupError, TypeError):
            data = None
    return key.removeprefix(".")
