"""All kinds of effects, in the order of the report."""

from rov_fmu.identify.effects.advance import Advance
from rov_fmu.identify.effects.current import Current, CurrentEast, CurrentNorth
from rov_fmu.identify.effects.dead_band import DeadBand
from rov_fmu.identify.effects.delay import Delay
from rov_fmu.identify.effects.effect import Effect
from rov_fmu.identify.effects.lag import Lag
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.effects.reverse import ReverseDrag, ReverseThrust
from rov_fmu.identify.effects.voltage import Voltage

_OF_FORCES = Lag, Load, ReverseDrag, ReverseThrust, DeadBand, Advance, Voltage
EFFECTS: dict[str, type[Effect]] = {
    effect.kind: effect for effect in (*_OF_FORCES, Delay, Current, CurrentNorth, CurrentEast)
}
"""Each effect by its kind."""
