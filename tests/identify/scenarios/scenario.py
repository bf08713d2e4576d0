"""What a scenario is: a folder of tests by a seed, the true numbers, and what the identification is held to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

import numpy as np

from tests.folders import HEAD, folder_of
from verification.references.pool import Array

COMMANDS = (0.3, 0.5, -0.3, -0.5)
"""The commands of an axis at which V_ss is judged. An identification must answer the positive ones."""

Truths = Mapping[tuple[str, str], float]
"""The true numbers by axis and name: ("surge", "a_d_u"), ("surge", "V_ss 30 %"); the axis of a curve's is empty."""


def steady_name(command: float) -> str:
    """Return the name of V_ss at a command, a fraction of the full command: `V_ss 30 %`."""
    return f"V_ss {100.0 * command:g} %"


@dataclass(frozen=True)
class Expected:
    """What the identification is held to in a scenario."""

    effects: tuple[str, ...] = ()
    """The kinds of effects that are really there, of anything (`delay`) or of one thing only (`load of heave`)."""
    causes: tuple[str, ...] = ()
    """The words of which a named cause of a disturbance must have one. Without any, only `unknown` is right."""
    complete: bool = True
    """True if the model can explain the data: intervals cover, nothing is biased, no alarm is raised."""
    unusable: tuple[str, ...] = ()
    """The axes of which at least one must be called `do not use`."""
    seconds: float = inf
    """The most processor time of an identification, s."""


NOTHING_SPECIAL = Expected()


# ---- A battery -------------------------------------------------------------------------------------------------------

VOLTAGE = 16.0
"""The voltage of a full battery, V."""
_EXPONENT = 1.5
"""Thrust is proportional to this power of the voltage."""


def voltage(time: float) -> float:
    """Return the voltage (V) of a battery that loses 10 % in 60 s."""
    return VOLTAGE * (1.0 - 0.1 * time / 60.0)


def sagging(time: float) -> float:
    """Return the factor of the thrust under that voltage."""
    return float((voltage(time) / VOLTAGE) ** _EXPONENT)


# ---- Folders ---------------------------------------------------------------------------------------------------------

Table = Mapping[str, Array]
"""The columns of a table by their headers."""


@dataclass(frozen=True)
class Given:
    """A coefficient that rov.toml gives."""

    value: float
    unit: str


EXACT_THRUST = {"thrust": 0.0, "thrust_shape": 0.0}
"""The priors of thrust curves without error, with which the absolute drag can be judged."""
KNOWN_THRUST = {"thrust": 1e-4, "thrust_shape": 1e-4}
"""The same for curves of which the dead band and the ratio of the thrust astern are free."""


def write_folder(
    folder: Path,
    tables: Mapping[str, Table],
    *,
    base: str,
    known: Mapping[str, Given],
    fit: Sequence[str] = (),
    priors: Mapping[str, float] = {},
) -> None:
    """Write a folder of tests: its tables by file, and all that rov.toml tells.

    The hardware is that of a base. `fit` names the keys of [fit] that are true.
    """
    text = f'base = "{base}"\n{HEAD}'
    lines = {
        "known": [
            f'{name} = {{ value = {given.value!r}, unit = "{given.unit}", source = "measured" }}'
            for name, given in known.items()
        ],
        "fit": [f"{key} = true" for key in fit],
        "priors": [f"{key} = {deviation}" for key, deviation in priors.items()],
    }
    text += "".join("\n".join([f"\n[{table}]", *entries, ""]) for table, entries in lines.items() if entries)
    folder_of(folder, text, {name: _csv(table) for name, table in tables.items()})


def _csv(table: Table) -> str:
    """Return the text of a CSV file. A cell is empty where there is no number."""
    rows = zip(*table.values(), strict=True)
    return "\n".join([",".join(table), *(",".join("" if np.isnan(x) else f"{x:.8g}" for x in row) for row in rows), ""])
