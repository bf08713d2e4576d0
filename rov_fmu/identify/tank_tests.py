"""A folder of tank tests (CSV) and what is given beforehand (rov.toml), read and checked.

The name of a file, in small or capital letters, says what it holds and of which thruster or axis; what follows an
underscore is free:

    thrust_<rear|top>*.csv                     command, force                  bollard pull, (6)-(10)
    steady_<surge|heave|yaw>*.csv              command, velocity               Tables 3-5
    time_constant_<surge|heave|yaw>*.csv       command, time constant          (17), Tables 6-8
    log_<surge|heave|yaw>*.csv                 time, command, and distance, depth or heading, or velocity

Every column has its unit in its header: `command [%]`. Commands are those of an Axis; a rear command is that of
both rear thrusters, opposite in yaw. Numbers leave this module in SI units, commands as fractions of full thrust.
"""

import hashlib
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, ValidationInfo, create_model, model_validator

from rov_fmu.files.csv_table import Column, DataFileError, read_columns
from rov_fmu.files.reading import read_bytes
from rov_fmu.files.toml_file import Strict, beside, pair, read_checked
from rov_fmu.motion.layout import Axis
from rov_fmu.vehicle.first import QUANTITIES
from rov_fmu.vehicle.form import Head, Validity
from rov_fmu.vehicle.paper import PAPER
from rov_fmu.vehicle.quantity import Finite, Quantity
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleFileError

ROV_FILE = "rov.toml"
AXES = {form.axis.name: form.axis for form in PAPER.axes}
THRUSTERS = tuple(curve.name for curve in PAPER.curves)
"""Those tested alone or as a pair, by their curves."""
_NAME = re.compile(
    rf"(?P<kind>thrust|steady|time_constant|log)_(?P<of>{'|'.join((*THRUSTERS, *AXES))})(?:_.*)?\.csv", re.IGNORECASE
)
_REQUIRED = ("m_rov", "I_r", "R", "gamma")  # geometry and mass: not identifiable in the tank
_LEAST_SAMPLES = 20


def thruster_of(axis: Axis) -> str:
    """The one of THRUSTERS that drives an axis."""
    return PAPER.drivers(axis)[0].curve


def thrust_names(axis: Axis) -> tuple[str, str]:
    """The coefficients of the thrust curve of an axis."""
    return f"a_t_{thruster_of(axis)}", f"b_t_{thruster_of(axis)}"


@dataclass(frozen=True)
class Row:
    """One measured number: force (N), velocity (m/s, rad/s) or time constant (s) at a held command."""

    file: str
    line: int
    command: float
    value: float


@dataclass(frozen=True, eq=False)
class Recording:
    """Command and motion over time, n samples; SI units, the heading unwrapped."""

    file: str
    axis: Axis
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading."""
    time: NDArray[np.float64]
    """s, ascending, from 0."""
    command: NDArray[np.float64]
    """Held from its time to the next one."""
    values: NDArray[np.float64]
    """NaN where the sensor has none."""

    @property
    def is_position(self) -> bool:
        """Whether the velocity is the rate of the values."""
        return self.quantity != "velocity"

    @property
    def unit(self) -> str:
        """Of the values."""
        return self.axis.position_unit if self.is_position else self.axis.unit


@dataclass(frozen=True)
class Given:
    """What is given beforehand (rov.toml)."""

    head: Head
    known: Mapping[str, Quantity]
    """Coefficients that are given, not identified: mass, moment of inertia, geometry, maybe more."""
    windows: Mapping[str, tuple[float, float]]
    """Of thrust_rear, thrust_top, surge, heave, yaw: rows at commands outside weigh nothing, (7)."""
    command_range: tuple[float, float] | None
    against: Path | None
    """A vehicle file to set beside."""
    limits: tuple[str, ...] = ()
    """What was found of the vehicle that the model leaves out, in sentences."""


@dataclass(frozen=True)
class TankTests:
    """All tests of a folder."""

    folder: Path
    given: Given
    thrust: Mapping[str, tuple[Row, ...]]
    """By thruster."""
    steady: Mapping[str, tuple[Row, ...]]
    """By axis, as the next two."""
    time_constants: Mapping[str, tuple[Row, ...]]
    recordings: Mapping[str, tuple[Recording, ...]]
    inputs: Mapping[str, str]
    """SHA-256 of every file read, by its name."""

    @property
    def files(self) -> list[Path]:
        """Every file that the identification reads."""
        return [*(self.folder / name for name in self.inputs), *filter(None, (self.given.against,))]


def load_tank_tests(folder: Path) -> TankTests:
    """Read a folder. Raises DataFileError, VehicleFileError."""
    if not folder.is_dir():
        raise DataFileError(f"{folder}: there is no such folder")
    given = _load_given(folder / ROV_FILE)
    found: dict[str, Any] = {kind: {} for kind in ("thrust", "steady", "time_constant", "log")}
    inputs = {ROV_FILE: _hash(folder / ROV_FILE)}
    for path in sorted(path for path in folder.iterdir() if path.name.lower().endswith(".csv")):
        match = _NAME.fullmatch(path.name)
        kind, of = (match["kind"].lower(), match["of"].lower()) if match else ("", "")
        if of not in (THRUSTERS if kind == "thrust" else AXES) or not path.name.isprintable():
            raise DataFileError(
                f"{path}: no name of a test; thrust_ begins one, then rear or top, or steady_, time_constant_ or log_, "
                "then surge, heave or yaw, then _ and any printable characters"
            )
        read = [_recording(path, AXES[of])] if kind == "log" else _rows(path, kind, of)
        found[kind][of] = (*found[kind].get(of, ()), *read)
        inputs[path.name] = _hash(path)
    if len(inputs) == 1:
        raise DataFileError(f"{folder}: there are no tests (*.csv) in this folder")
    return TankTests(folder, given, found["thrust"], found["steady"], found["time_constant"], found["log"], inputs)


# ---- rov.toml --------------------------------------------------------------------------------------------------------


def _window(window: tuple[float, float]) -> tuple[float, float]:
    if not -1.0 <= window[0] < window[1] <= 1.0:
        raise ValueError("must be [low, high] within -1 ... 1, fractions of full thrust: 20 % is 0.2")
    return window


_Window = Annotated[tuple[Finite, Finite], BeforeValidator(pair), AfterValidator(_window)]
_known: dict[str, Any] = {name: (q, ...) if name in _REQUIRED else (q | None, None) for name, q in QUANTITIES.items()}
_AnyKnown = create_model("_AnyKnown", __base__=Strict, **_known)


class _Known(_AnyKnown):  # type: ignore[misc, valid-type]
    @model_validator(mode="after")
    def _whole_curves(self) -> "_Known":
        for names in ((f"a_t_{thruster}", f"b_t_{thruster}") for thruster in THRUSTERS):
            given = [name for name in names if getattr(self, name)]
            if len(given) == 1:
                raise ValueError(f"{given[0]} is given, but {min(set(names) - set(given))} is not")
        return self


_windows: dict[str, Any] = dict.fromkeys((*(f"thrust_{t}" for t in THRUSTERS), *AXES), (_Window | None, None))
_Windows = create_model("_Windows", __base__=Strict, **_windows)


def _vehicle(name: str, info: ValidationInfo) -> str:
    if not _vehicle_file(name, beside(name, info)):
        raise ValueError(
            f"must be a vehicle file, seen from this folder, or one of the vehicles that ship: {', '.join(SHIPPED)}"
        )
    return name


def _vehicle_file(name: str, path: Path) -> Path | None:
    """The vehicle file at a path, or the one that ships under the name."""
    return path if os.path.isfile(path) else SHIPPED.get(name)  # noqa: PTH113 (as in vehicle.py)


class _RovFile(Strict):
    against: Annotated[str, AfterValidator(_vehicle)] | None = None
    vehicle: Head
    known: _Known
    windows: _Windows = _Windows()  # type: ignore[valid-type]
    validity: Validity | None = None


def _load_given(path: Path) -> Given:
    checked = read_checked(path, _RovFile, VehicleFileError)
    return Given(
        head=checked.vehicle,
        known={name: q for name in _known if (q := getattr(checked.known, name))},
        windows={name: window for name in _windows if (window := getattr(checked.windows, name))},
        command_range=checked.validity.command_range if checked.validity else None,
        against=_vehicle_file(checked.against, path.parent / checked.against) if checked.against else None,
        limits=checked.validity.limits if checked.validity else (),
    )


# ---- CSV files -------------------------------------------------------------------------------------------------------

# The bounds are far beyond any vehicle; what passes them is a slip, and numbers without any would overflow in a fit.
_COMMAND = Column({"%": 100.0, "1": 1.0}, minimum=-1.0, maximum=1.0)
HELD_COMMAND = replace(_COMMAND, least=1e-4)
_LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
_ANGLES = {"rad": 1.0, "deg": 180.0 / pi}
_TIMES = {"s": 1.0, "ms": 1000.0}
_FORCE = Column({"N": 1.0}, minimum=-1e6, maximum=1e6)
_TIME = Column(_TIMES, minimum=-1e10, maximum=1e10)  # a logger's may count from 1970
VELOCITIES = 1e-5, 1e3  # the least and the most
_MOST_POSITION = 1e7


def velocity_column(axis: Axis, *, optional: bool = False, least: float = VELOCITIES[0]) -> Column:
    """A column of velocities along the axis; an optional one may have blanks."""
    lengths = _ANGLES if axis.unit == "rad/s" else _LENGTHS
    units = {f"{unit}/s": per for unit, per in lengths.items()}
    return Column(units, optional, optional, -VELOCITIES[1], VELOCITIES[1], least)


def time_constant_column(*, optional: bool = False) -> Column:
    """A column of time constants; an optional one may have blanks."""
    return Column(_TIMES, optional, optional, maximum=1e5, least=1e-4)


def _rows(path: Path, kind: str, of: str) -> Iterator[Row]:
    """Rows of command, and force, velocity or time constant."""
    name = {"thrust": "force", "steady": "velocity", "time_constant": "time constant"}[kind]
    column = _FORCE if kind == "thrust" else velocity_column(AXES[of]) if kind == "steady" else time_constant_column()
    table = read_columns(path, {"command": HELD_COMMAND, name: column})
    noise = 0.05 * max(map(abs, table.values[name]))
    numbers = zip(table.lines, table.values["command"], table.values[name], strict=True)
    for n, (line, command, value) in enumerate(numbers):
        if kind == "thrust" and command * value < 0.0 and abs(value) > noise:
            raise table.error(n, name, "must have the sign of the command, for a thruster pushes where it is told to")
        if kind != "thrust" and command == 0.0:
            raise table.error(n, "command", "must not be zero, for nothing moves")
        if kind == "steady" and command * value <= 0.0:
            raise table.error(n, name, "must have the sign of the command: forward, down, bow to starboard is +")
        if kind == "time_constant" and value <= 0.0:
            raise table.error(n, name, "must be above 0")
        yield Row(path.name, line, command, value)


def _recording(path: Path, axis: Axis) -> Recording:
    """Time, command and motion; the position where there are both position and velocity."""
    units = _ANGLES if axis.position_unit == "rad" else _LENGTHS
    columns = {
        "time": _TIME,
        "command": _COMMAND,
        axis.position: Column(units, True, True, -_MOST_POSITION, _MOST_POSITION),
        "velocity": velocity_column(axis, optional=True, least=0.0),
    }
    table = read_columns(path, columns, others=True)
    quantity = next((name for name in (axis.position, "velocity") if name in table.values), None)
    if not quantity:
        wanted = " or ".join(f"'{name} [{next(iter(columns[name].units))}]'" for name in (axis.position, "velocity"))
        raise DataFileError(f"{path}, line 1: column {wanted} is missing")
    time, values = np.array(table.values["time"]), np.array(table.values[quantity])
    backward = np.flatnonzero(np.diff(time) <= 0.0)
    if backward.size:
        raise table.error(int(backward[0]) + 1, "time", "must be later than in the row above")
    there = np.isfinite(values)
    if there.sum() < _LEAST_SAMPLES:
        raise DataFileError(f"{path}: {there.sum()} samples of {quantity}, at least {_LEAST_SAMPLES} are needed")
    if quantity == "heading":
        values[there] = np.unwrap(values[there])
    return Recording(path.name, axis, quantity, time - time[0], np.array(table.values["command"]), values)


def _hash(path: Path) -> str:
    return hashlib.sha256(read_bytes(path, DataFileError)).hexdigest()
