"""The kinds of files, and messages about a file that is of another kind than a command expects."""

from collections.abc import Iterable
from pathlib import Path

from rov_fmu.io.messages import FileError

VEHICLE_FILE, PLAN, FMU, PAGE = "a vehicle file (TOML)", "the plan of a study (TOML)", "an FMU", "a page (HTML)"
GAZEBO_MODEL = "a model for Gazebo (SDF)"
SYSTEM, SYSTEM_PLAN = "a system (SSP)", "the plan of a system (TOML)"
TESTS, TESTS_FILE = "a log, or a folder of tank tests", "the rov.toml of a folder of tank tests"
LOG, _TOML, _TABLE = "the log of an autopilot, of ROS or of MATLAB", "a TOML file", "a recording or a table (CSV)"
DATAFLASH_SUFFIX = ".bin"
"""The suffix of a DataFlash log, which the autopilot writes."""
MAVLINK_SUFFIXES = (DATAFLASH_SUFFIX, ".tlog")
"""The suffixes of logs of ArduSub; a .tlog is the telemetry log of a ground station."""
ULOG_SUFFIX = ".ulg"
"""The suffix of a log of PX4."""
BAG_SUFFIXES = (".bag", ".db3", ".mcap", ".zstd")
"""The suffixes of a bag of ROS 1 and of the files in a bag of ROS 2, which it may compress: dive.db3.zstd."""
LOG_SUFFIXES = (*MAVLINK_SUFFIXES, ULOG_SUFFIX, *BAG_SUFFIXES)
"""The suffixes of logs that are no tables."""
TABLE_SUFFIXES = (".csv", ".mat")
"""The suffixes of tables: CSV files, and variables of MATLAB."""
_OWN = {".toml": _TOML, ".fmu": FMU, ".html": PAGE, ".sdf": GAZEBO_MODEL, ".ssp": SYSTEM}
OWN_SUFFIXES = (*_OWN,)
"""The suffixes of files that this program writes, or reads where another file or a command names them."""
_WRITTEN = {
    VEHICLE_FILE: (".toml",),
    FMU: (".fmu",),
    PAGE: (".html", ".htm"),
    SYSTEM: (".ssp",),
    GAZEBO_MODEL: (".sdf", ".urdf", ".world", ".xml", ".xacro"),
}
"""The suffixes that a file may have which a command writes, by its kind."""
_BY_SUFFIX = {
    **_OWN,
    **dict.fromkeys((".csv", ".tsv"), _TABLE),
    **dict.fromkeys((*LOG_SUFFIXES, ".mat"), LOG),
}
_BY_KEY = {
    **dict.fromkeys(("component", "connect"), SYSTEM_PLAN),
    **dict.fromkeys(("stop_time", "vary", "figures"), PLAN),
    **dict.fromkeys(("known", "windows", "base"), TESTS_FILE),
    **dict.fromkeys(("thruster", "axes"), VEHICLE_FILE),
}
"""Keys at the top of a TOML file, each with the only or the most likely kind of file that has it."""
_BY_NAME = {"rov.toml": TESTS_FILE}
"""Files whose name alone tells their kind: a rov.toml may have the thrusters of a vehicle file."""
_HINTS = {
    VEHICLE_FILE: "`rov-fmu build` makes an FMU of it, and a plan names it as `vehicle`",
    PLAN: "`rov-fmu study` carries it out",
    SYSTEM_PLAN: "`rov-fmu system` makes a system of it",
    SYSTEM: "a plan of a study names it as `system`",
    FMU: "`rov-fmu prove` runs its experiments, and a plan names it as `fmu`",
    TESTS_FILE: "`rov-fmu identify FOLDER -o VEHICLE.toml` makes a vehicle file of the folder",
    _TOML: "`rov-fmu build` makes an FMU of a vehicle file",
    **dict.fromkeys(
        (_TABLE, LOG), "`rov-fmu inspect` lists what it contains, and `rov-fmu identify` makes a vehicle file of it"
    ),
}


def kind_of(path: Path, keys: Iterable[str] = ()) -> str:
    """Return the kind of a file by its name, the keys at its top, or its suffix; empty for an unknown one."""
    named = [_BY_NAME[path.name]] if path.name in _BY_NAME else [_BY_KEY[key] for key in keys if key in _BY_KEY]
    return (named or [_BY_SUFFIX.get(path.suffix.lower(), "")])[0]


def use_of(kind: str) -> str:
    """Return what a kind of file is for, in words; empty where that needs none."""
    return _HINTS.get(kind, "")


def check_suffix(path: Path, wanted: str, failure: type[FileError] = FileError) -> None:
    """Raise `failure` if the suffix of a file belongs to another kind than the wanted one."""
    if kind := _other_kind(path, wanted):
        raise failure(_message(path, wanted, kind))


def check_keys(path: Path, keys: Iterable[str], wanted: str, failure: type[FileError]) -> None:
    """Raise `failure` if the keys of a TOML file belong to another kind than the wanted one."""
    kinds = dict.fromkeys(_BY_KEY[key] for key in keys if key in _BY_KEY)
    if kinds and wanted not in kinds:
        raise failure(_message(path, wanted, next(iter(kinds))))


def check_written(path: Path, kind: str) -> None:
    """Raise FileError unless the suffix of a path to write is one of this kind of file."""
    if path.suffix.lower() not in _WRITTEN[kind]:
        other = _BY_SUFFIX.get(path.suffix.lower())
        must_end = f"the name must end with {' or '.join(_WRITTEN[kind])}"
        reason = f"{path.suffix} is the suffix of {other}" if other else must_end
        raise FileError(f"{path}: would be {kind}, but {reason}")


def _other_kind(path: Path, wanted: str) -> str | None:
    """Return the kind of file that the suffix belongs to, or None if it is the wanted kind or unknown."""
    kind = _BY_SUFFIX.get(path.suffix.lower())
    if kind == wanted or (kind == _TOML and wanted in (VEHICLE_FILE, PLAN, SYSTEM_PLAN)):
        return None
    return kind


def _message(path: Path, wanted: str, kind: str) -> str:
    """Return the line about a file of the wrong kind, with what to do with such a file."""
    hint = f"; {_HINTS[kind]}" if kind in _HINTS else ""
    return f"{path}: must be {wanted}, and not {kind}{hint}"
