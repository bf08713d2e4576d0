"""The tables of the vehicle file that describe it: [vehicle], [validity], [provenance]."""

import os
import re
from collections.abc import Iterable
from itertools import chain
from math import inf
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from rov_fmu.io.output import is_same
from rov_fmu.io.paths import inside, inside_or_shipped
from rov_fmu.io.toml_file import Strict, as_tuple, folder_of
from rov_fmu.vehicle.quantity import Name, Text

_RESERVED = re.compile("CON|PRN|AUX|NUL|(COM|LPT)[0-9]", re.I)
"""Names of devices in Windows, which no file can have there, whatever its extension."""


def _identifier(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,99}", text):
        raise ValueError("must be a C identifier: at most 100 letters, digits and underscores, no digit first")
    if _RESERVED.fullmatch(text):
        raise ValueError("must not be a name that Windows reserves: CON, PRN, AUX, NUL, COM0 ... COM9, LPT0 ... LPT9")
    return text


class Head(Strict):
    """What a vehicle is called and where it comes from."""

    name: Name
    """For people; at most 100 characters."""
    identifier: Annotated[str, AfterValidator(_identifier)]
    """A C identifier that Windows does not reserve: modelIdentifier and modelName of the FMU, and its file name."""
    version: Name
    """Of the vehicle; goes into the FMU."""
    description: Text
    """One sentence; goes into the FMU."""
    source: Text
    """Who identified it, where it is published; the FMU's author."""


TABLES = {
    "heave": ("table6_heave_response.csv", "table3_heave_steady.csv"),
    "yaw": ("table7_yaw_response.csv", "table5_yaw_steady.csv"),
    "surge": ("table8_surge_response.csv", "table4_surge_steady.csv"),
}
"""Files of published tables in the data folder, by axis: responses, and measured steady velocities."""
PICTURES = ("model.png", "from_above.svg", "from_starboard.svg")
"""Files in the folder of pictures."""


def _folder(files: Iterable[str]) -> AfterValidator:
    """A folder beside the file. The files in it that are read must not be links that lead elsewhere."""

    def check(name: str, info: ValidationInfo) -> str:
        if not os.path.isdir(inside_or_shipped(folder_of(info), name)):  # noqa: PTH112 (Path.is_dir raises on names
            raise ValueError("there is no such folder beside the file")  # that are too long)
        for file in files:
            try:
                inside(folder_of(info), f"{name}/{file}")
            except ValueError as error:
                raise ValueError(f"its file {file} {error}") from error
        return name

    return AfterValidator(check)


class FileHead(Head):
    """What a vehicle is called, where it comes from, and the folders beside its file."""

    data: Annotated[str, _folder([*chain(*TABLES.values())])] | None = None
    """A folder beside the file with the published tables, as `rov-fmu tables` prints them, or one that ships
    (`videoray/tables`); its files are named and headed as those of `models/videoray/tables`."""
    pictures: Annotated[str, _folder(PICTURES)] | None = None
    """A folder beside the file with the vehicle's own `model.png`, `from_above.svg`, `from_starboard.svg`, or one that
    ships (`videoray/pictures`). Drawings are shown on a light ground. The icon and the thrusters are drawn from their
    geometry in any case."""

    def folders_from(self, folder: Path) -> dict[str, Path | None]:
        """The folders `data` and `pictures` that a file in this folder names."""
        names = {"data": self.data, "pictures": self.pictures}
        return {key: inside_or_shipped(folder, name) if name else None for key, name in names.items()}


_Command = Annotated[float, Field(ge=0.0, le=1.0)]


def _below(low: float, info: ValidationInfo) -> float:
    if low >= (high := info.data.get("command_max", inf)):
        raise ValueError(f"must be less than command_max = {high}")
    return low


class Validity(Strict):
    """Thruster commands over which the model holds."""

    command_max: _Command
    """Strongest thruster command over which the model was identified, a fraction of full thrust."""
    command_min: Annotated[_Command, AfterValidator(_below)]
    """Weakest one."""
    limits: Annotated[tuple[Text, ...], BeforeValidator(as_tuple)] = ()
    """What was found of this vehicle that the model leaves out, in sentences; they stand in the FMU's documentation."""

    @property
    def command_range(self) -> tuple[float, float]:
        """From the weakest to the strongest."""
        return self.command_min, self.command_max


def _report(name: str, info: ValidationInfo) -> str:
    path, coming = inside(folder_of(info), name), (info.context or {})["coming"]
    if not (os.path.isfile(path) or (coming and is_same(path, coming))):  # noqa: PTH113 (as above)
        raise ValueError("there is no such file beside this one")
    return name


class Made(Strict):
    """What made the file, as `rov-fmu identify` writes it; a file written by hand needs none."""

    tool: Text
    """What made the file."""
    method: Text
    """How."""
    inputs: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    """File name to SHA-256 of every input."""
    warnings: Annotated[tuple[Text, ...], BeforeValidator(as_tuple)] = ()
    """What the data do not determine, in sentences."""
    report: Annotated[Text, AfterValidator(_report)] | None = None
    """The report, a file beside this one; a build puts it into the FMU."""

    def report_in(self, folder: Path) -> Path | None:
        """The path of the report."""
        return folder / self.report if self.report else None
