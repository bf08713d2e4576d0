"""The tables of the vehicle file that describe it: [vehicle], [validity], [provenance]."""

import os
import re
from collections.abc import Iterable, Mapping
from itertools import chain
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, WithJsonSchema

from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.parts import EVERY_COMMAND, Range
from rov_fmu.io.output import is_same
from rov_fmu.io.paths import inside, inside_or_shipped, is_portable
from rov_fmu.io.toml_file import AS_TUPLE, TEXT_SCHEMA, Finite, Name, Strict, Text, folder_of, printable, rule
from rov_fmu.vehicle.quantity import Interval

_KEYWORDS = re.compile(
    "auto|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long|register|"
    "restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile|while|"
    "alignas|alignof|bool|constexpr|false|nullptr|static_assert|thread_local|true|typeof|typeof_unqual|"
    "_(Alignas|Alignof|Atomic|BitInt|Bool|Complex|Decimal(32|64|128)|Generic|Imaginary|Noreturn|Static_assert|Thread_local)"
)
"""The keywords of C, from C99 to C23."""


def why_no_identifier(text: str) -> str:
    """Return why a text cannot name an FMU on every system, or an empty text."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,99}", text):
        return "must be a C identifier: at most 100 letters, digits and underscores, no digit first"
    if _KEYWORDS.fullmatch(text):
        return "must be a C identifier, and not a keyword of C"
    if not is_portable(text):
        return "must not be a name that Windows reserves: CON, PRN, AUX, NUL, COM0 ... COM9, LPT0 ... LPT9"
    return ""


def _identifier(text: str) -> str:
    """Return the text if it can name an FMU. Raises ValueError."""
    if reason := why_no_identifier(text):
        raise ValueError(reason)
    return text


class Head(Strict):
    """The names of a vehicle, and where it comes from."""

    name: Name
    """The name for people; at most 100 characters."""
    identifier: Annotated[str, AfterValidator(_identifier)]
    """A C identifier that neither C nor Windows reserves: the name of the FMU."""
    version: Name
    """The version of the vehicle."""
    description: Text
    """One sentence."""
    source: Text
    """Who identified the vehicle, and where; the FMU's author."""


TABLES = {
    "heave": ("table6_heave_response.csv", "table3_heave_steady.csv"),
    "yaw": ("table7_yaw_response.csv", "table5_yaw_steady.csv"),
    "surge": ("table8_surge_response.csv", "table4_surge_steady.csv"),
}
"""The files of published tables in the data folder, by axis: responses, and measured steady velocities."""
PICTURES = ("model.png", "from_above.svg", "from_starboard.svg")
"""The files in the folder of pictures."""


def _folder(files: Iterable[str]) -> BeforeValidator:
    """Return a validator that gives the path of a folder beside the file.

    The given files in it must not be links that lead elsewhere.
    """

    def check(name: object, info: ValidationInfo) -> Path:
        if not isinstance(name, str):
            raise ValueError("must be text in quotes")
        folder = inside_or_shipped(folder_of(info), name)
        if not os.path.isdir(folder):  # noqa: PTH112 (Path.is_dir raises an exception if the name is too long)
            raise ValueError("there is no such folder beside the file")
        for file in files:
            try:
                inside(folder_of(info), f"{name}/{file}")
            except ValueError as error:
                raise ValueError(f"its file {file} {error}") from error
        return folder

    return BeforeValidator(check)


_NAME_OF_REPORT = WithJsonSchema({"type": "string", "minLength": 1, "maxLength": 10_000})


class FileHead(Head):
    """Names, source, and folders beside the file."""

    data: Annotated[Path, _folder([*chain(*TABLES.values())]), TEXT_SCHEMA] | None = None
    """A folder with the published tables that `python -m verification.tables` prints, in the form of
    `models/videoray/tables`."""
    pictures: Annotated[Path, _folder(PICTURES), TEXT_SCHEMA] | None = None
    """A folder with the vehicle's own `model.png`, `from_above.svg`, `from_starboard.svg`, for a light background. The
    icon and the thrusters are always drawn from their geometry."""


_Sentences = Annotated[tuple[Text, ...], AS_TUPLE]
_Command = Annotated[float, Field(ge=0.0, le=1.0)]


def _below_maximum(low: float, info: ValidationInfo) -> float:
    """Return `command_min` if it is less than `command_max`. Raises ValueError."""
    if low >= (high := info.data.get("command_max", inf)):
        raise ValueError(f"must be less than command_max = {high}")
    return low


UNIT_OF_RANGE = {axis.velocity: axis.unit for axis in AXES.values()} | {"phi": "rad", "theta": "rad", "z": "m"}
"""The quantities that a range may be given for, and their units."""
LEAST_RANGE = 1e-6
"""The least size of the larger end of a range, in SI units."""


_NOT_EMPTY = rule(
    f"must be [low, high], and one of them at least {LEAST_RANGE:g} away from 0",
    lambda ends: ends[0] <= ends[1] and max(map(abs, ends)) >= LEAST_RANGE,
)


class IdentifiedRange(Strict):
    """The range of a velocity, of an angle or of the depth over which the vehicle was identified."""

    range: Annotated[Interval, _NOT_EMPTY]
    """The ends, [low, high]."""
    unit: Literal["m/s", "rad/s", "rad", "m"]


def _by_quantity(word: str, units: Mapping[str, str]) -> AfterValidator:
    """Return a validator of values by the names of quantities, which have these units. A word tells what they are."""

    def check(given: dict[str, Any]) -> dict[str, Any]:
        for name, one in given.items():
            if name not in units:
                raise ValueError(f"must have {word}s of {', '.join(units)}, and not of {name}")
            if getattr(one, "unit", units[name]) != units[name]:
                raise ValueError(f"must have the {word} of {name} in {units[name]}, and not in {one.unit}")
        return given

    return AfterValidator(check)


_BETWEEN_FULL = rule(
    "must be [low, high] with -1 <= low <= 0 <= high <= 1", lambda ends: -1.0 <= ends[0] <= 0.0 <= ends[1] <= 1.0
)


_UNITS_OF_AXES = {name: axis.unit for name, axis in AXES.items()}


class StatedSpeed(Strict):
    """The top speed along an axis, in its positive direction, as somebody states it of the real vehicle."""

    value: Annotated[Finite, Field(gt=0.0)]
    """The speed."""
    unit: Literal["m/s", "rad/s"]
    source: Text
    """Who states it, as the subject of a sentence: `its maker`."""
    measured: Annotated[Interval, _NOT_EMPTY] | None = None
    """The velocities between which the coefficients of the axis were measured, where this is known."""


class Validity(Strict):
    """Where the model holds, and what it leaves out."""

    command_max: _Command
    """The strongest command for which the model was identified."""
    command_min: Annotated[_Command, AfterValidator(_below_maximum)]
    """The weakest such command."""
    identified: Annotated[dict[str, IdentifiedRange], _by_quantity("range", UNIT_OF_RANGE)] = Field(default={})
    """The identified ranges of the velocities u, v, w, p, q, r, of roll phi, pitch theta and depth z, which
    `rov-fmu identify` writes. With them, the FMU has the output `outside`."""
    tested: Annotated[dict[str, Annotated[Interval, _BETWEEN_FULL]], _by_quantity("command", _UNITS_OF_AXES)] = Field(
        default={}
    )
    """The commands along each axis between which tests of this axis held it long enough, as in `surge = [-0.52, 0.57]`,
    which `rov-fmu identify` writes. An axis that is not among them was tested up to `command_max`."""
    stated: Annotated[dict[str, StatedSpeed], _by_quantity("speed", _UNITS_OF_AXES)] = Field(default={})
    """The top speeds that others state of the real vehicle, by axis, such as `surge = { value = 1.5, unit = "m/s",
    source = "its maker" }`. If the model differs by more than 10 %, `fly`, `sitl` and the model card say so. The key
    `measured`, `[low, high]`, tells between which velocities the coefficients were measured."""
    limits: _Sentences = ()
    """Known effects that the model leaves out, in sentences, for the FMU's documentation."""

    @property
    def command_range(self) -> tuple[float, float]:
        """The weakest and the strongest command."""
        return self.command_min, self.command_max

    @property
    def ranges(self) -> tuple[Range, ...]:
        """The ranges as the layout has them; none if there are only those of the commands."""
        if not self.identified:
            return ()
        measured = (Range(name, *one.range) for name, one in self.identified.items())
        return (Range(EVERY_COMMAND, 0.0, self.command_max), *measured)


def _report(name: object, info: ValidationInfo) -> Path:
    """Return the path of the report if the file exists or is about to be written. Raises ValueError."""
    if not isinstance(name, str):
        raise ValueError("must be text in quotes")
    if not name.strip():
        raise ValueError("must not be blank" if name else "must have at least 1 character")
    path, coming = inside(folder_of(info), printable(name)), (info.context or {})["coming"]
    if not (os.path.isfile(path) or (coming and is_same(path, coming))):  # noqa: PTH113 (as above)
        raise ValueError("there is no such file beside this one: copy it there, or remove this key")
    return folder_of(info) / name


Word = Literal["good", "usable", "do not use", "not identified"]
"""Whether the model of an axis may be trusted, the best word first."""
VERDICT = re.compile(rf"([\w ]+): ({'|'.join(get_args(Word))})[.:] ?(.*)")
"""A sentence with the verdict of an axis and its reasons."""


class Provenance(Strict):
    """What made the file, as `rov-fmu identify` writes it."""

    tool: Text
    """The tool that made the file."""
    method: Text
    """How the tool made the file."""
    report: Annotated[Path, BeforeValidator(_report), _NAME_OF_REPORT] | None = None
    """The name of the report, a file beside this one. A build puts it into the FMU."""
    verdicts: _Sentences = ()
    """Whether the model of each axis may be trusted, with the reasons."""
    errors: _Sentences = ()
    """The errors of predictions of unseen data."""
    tested: _Sentences = ()
    """The ranges of what was measured, such as `depth: 0.2 to 3.1 m`, as earlier versions wrote them. Now
    `[validity.identified]` has them."""
    warnings: _Sentences = ()
    """What the data do not determine, and what speaks against the model, in sentences."""
    facts: _Sentences = ()
    """What was found, and what was done with the data, in sentences."""
    hash: Literal["SHA-256", "SHA3-256"] = "SHA-256"
    """The kind of the hashes in `inputs`."""
    inputs: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    """The hash of every input file, by file name."""

    @property
    def words(self) -> dict[str, str]:
        """The word of each verdict, by the name of its axis."""
        return {found[1]: found[2] for found in map(VERDICT.fullmatch, self.verdicts) if found}
