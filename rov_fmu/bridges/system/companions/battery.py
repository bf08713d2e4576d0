"""A battery as a PythonFMU slave: the thrusters draw power, and the voltage sags. By default it is small and worn.

It gives the electric power that a vehicle tells. Where a vehicle tells none, the power of a propeller is proportional
to thrust^1.5 (the theory of the actuator disc). The battery is a source of voltage, which falls with the charge, behind
a resistance. By Peukert's law, a current I empties it in the time H (C / (H I))^k, where C is what it gives in H hours.
"""

from math import sqrt
from typing import ClassVar

from pythonfmu.enums import Fmi2Status

from rov_fmu.bridges.system.companions._common import Companion, Variables

THRUSTS = ("F_l", "F_r", "F_t")

# name: causality, start, unit, description
VARIABLES: Variables = {
    "electric_power": ("input", 0.0, "W", "Electric power of the thrusters"),
    "F_l": ("input", 0.0, "N", "Thrust F_l"),
    "F_r": ("input", 0.0, "N", "Thrust F_r"),
    "F_t": ("input", 0.0, "N", "Thrust F_t"),
    "voltage": ("output", 0.0, "V", "Voltage at the terminals"),
    "sag": ("output", 0.0, "1", "Drop of the voltage relative to a full battery without load"),
    "drawn": ("output", 0.0, "1", "Share of the capacity that has been drawn"),
    "electric_current": ("output", 0.0, "A", "Electric current"),
    "empty": ("output", False, "1", "The capacity has been drawn; the voltage stays that of an empty battery"),
    "overloaded": ("output", False, "1", "More power is asked for than the resistance lets pass"),
    "E_full": ("parameter", 25.2, "V", "Voltage of a full battery without load"),
    "E_empty": ("parameter", 21.0, "V", "Voltage of an empty battery without load"),
    "capacity": ("parameter", 0.15, "A.h", "Capacity"),
    "peukert": ("parameter", 1.0, "1", "Peukert's exponent, above 1 if a large current empties the battery sooner"),
    "rated_time": ("parameter", 20.0, "h", "Time of a steady discharge for which the capacity is stated"),
    "resistance": ("parameter", 1.0, "Ohm", "Internal resistance"),
    "hotel_load": ("parameter", 80.0, "W", "Power of camera, lights and electronics"),
    "k_P": ("parameter", 0.9, "W/N^1.5", "Electric power of a propeller over thrust^1.5"),
}


class Battery(Companion):
    """The slave. It starts full, without load."""

    description = "A battery: from electric power or thrusts to the voltage"
    limits: ClassVar = {
        "E_full": (0.01, 1e5),
        "E_empty": (0.01, 1e5),
        "capacity": (1e-6, 1e6),
        "peukert": (1.0, 2.0),
        "rated_time": (1e-3, 1e4),
        "resistance": (0.0, 1e4),
        "hotel_load": (0.0, 1e6),
        "k_P": (0.0, 1e6),
    }

    electric_power: float
    drawn: float
    E_full: float
    E_empty: float
    capacity: float
    peukert: float
    rated_time: float
    resistance: float
    hotel_load: float
    k_P: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.terminals = [("electric", ["electric_power"], ()), ("battery", ["voltage"], ())]
        self.register(VARIABLES, step=0.05)

    def exit_initialization_mode(self) -> None:
        """Begin full. Raises ValueError for a battery that cannot be."""
        self.check()
        self.voltage = self.E_full

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Draw the power of the thrusts over the step."""
        power = self.hotel_load + self.electric_power
        power += self.k_P * sum(abs(getattr(self, name)) ** 1.5 for name in THRUSTS)
        source = self.E_full - (self.E_full - self.E_empty) * min(self.drawn, 1.0)
        # V = source - resistance * power / V; at most the power is drawn at which V is half of the source.
        root = source**2 - 4.0 * self.resistance * power
        self.voltage = 0.5 * (source + sqrt(max(0.0, root)))
        self.electric_current = (source - self.voltage) / self.resistance if self.resistance else power / self.voltage
        share = max(self.electric_current, 0.0) * self.rated_time / self.capacity
        self.drawn += share**self.peukert * step_size / (3600.0 * self.rated_time)
        self.sag = 1.0 - self.voltage / self.E_full
        self._tell("overloaded", root < 0.0, f"{power:.4g} W are asked for, and it gives at most half of its voltage")
        self._tell("empty", self.drawn >= 1.0, f"its {self.capacity:g} A.h have been drawn")
        return True

    def _tell(self, name: str, is_so: bool, words: str) -> None:
        if is_so and not getattr(self, name):
            self.log(f"the battery is {name}: {words}", Fmi2Status.warning)
        setattr(self, name, is_so)
