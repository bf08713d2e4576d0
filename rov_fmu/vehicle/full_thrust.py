"""Thrust of which no more than the force at full command is known, about."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from rov_fmu.io.columns import FORCE_UNITS
from rov_fmu.io.messages import only
from rov_fmu.io.toml_file import Finite, Strict, rule
from rov_fmu.vehicle.quantity import Quantity
from rov_fmu.vehicle.schema import CurveTable

USUAL_SQUARE = 0.8
"""The usual share of the thrust at full command that grows with the square of the command."""


def usual_thrust(command: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the usual thrust at commands from -1 to 1, relative to that at full command, by (9), without dead band."""
    return (USUAL_SQUARE * np.abs(command) + (1.0 - USUAL_SQUARE)) * command


def _unit(unit: str) -> str:
    """Return a unit of a force. Raises ValueError."""
    if unit not in FORCE_UNITS:
        raise ValueError(f"must be {', '.join(FORCE_UNITS)}{only(unit, FORCE_UNITS)}")
    return unit


class FullThrust(Strict):
    """The force of one thruster at full command, about: the centre of a prior."""

    about: Annotated[Finite, rule("must be above 0", lambda force: force > 0.0)]
    unit: Annotated[str, AfterValidator(_unit)]


class CurveToFit(CurveTable):
    """A thrust curve in rov.toml, whose numbers are fitted."""

    thrust: FullThrust | None = None
    """The force of one thruster at full command, about."""

    @property
    def guess(self) -> dict[str, Quantity]:
        """The coefficients of a curve with this force, by their keys; none if it is not told."""
        if not self.thrust:
            return {}
        force = self.together * self.thrust.about / FORCE_UNITS[self.thrust.unit]
        source = f"{self.thrust.about:g} {self.thrust.unit} at full command, about, by rov.toml"
        shares = {"a_t": USUAL_SQUARE, "b_t": 1.0 - USUAL_SQUARE}
        return {key: Quantity(value=share * force, unit="N", source=source) for key, share in shares.items()}
