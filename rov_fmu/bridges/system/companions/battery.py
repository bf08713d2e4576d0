"""A small, worn battery as a PythonFMU slave: the thrusters draw power, and the voltage sags.

The power of a propeller is proportional to thrust^1.5 (the theory of the actuator disc). The battery is a source of
voltage, which falls with the charge, behind a resistance.
"""

from math import sqrt

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

THRUSTS = ("F_l", "F_r", "F_t")

# name: causality, start, unit, description
VARIABLES: dict[str, tuple[str, float, str, str]] = {
    "F_l": ("input", 0.0, "N", "Thrust F_l"),
    "F_r": ("input", 0.0, "N", "Thrust F_r"),
    "F_t": ("input", 0.0, "N", "Thrust F_t"),
    "sag": ("output", 0.0, "1", "Drop of the voltage relative to a full battery without load"),
    "drawn": ("output", 0.0, "1", "Share of the capacity that has been drawn"),
    "electric_current": ("output", 0.0, "A", "Electric current"),
    "E_full": ("parameter", 25.2, "V", "Voltage of a full battery without load"),
    "E_empty": ("parameter", 21.0, "V", "Voltage of an empty battery without load"),
    "capacity": ("parameter", 0.15, "A.h", "Capacity"),
    "resistance": ("parameter", 1.0, "Ohm", "Internal resistance"),
    "hotel_load": ("parameter", 80.0, "W", "Power of camera, lights and electronics"),
    "k_P": ("parameter", 0.9, "W/N^1.5", "Electric power of a propeller over thrust^1.5"),
}


class Battery(Fmi2Slave):  # type: ignore[misc]
    """The slave. It starts full, without load."""

    author = "rov-fmu"
    description = "A battery: from thrusts to the drop of the voltage"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=0.05)
    variables = VARIABLES

    drawn: float
    E_full: float
    E_empty: float
    capacity: float
    resistance: float
    hotel_load: float
    k_P: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        for name, (causality, start, _, text) in VARIABLES.items():
            setattr(self, name, start)
            changes = Fmi2Variability.tunable if causality == "parameter" else Fmi2Variability.continuous
            kind = {"causality": Fmi2Causality[causality], "variability": changes}
            self.register_variable(Real(name, description=text, **kind))

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Draw the power of the thrusts over the step."""
        power = self.hotel_load + self.k_P * sum(abs(getattr(self, name)) ** 1.5 for name in THRUSTS)
        source = self.E_full - (self.E_full - self.E_empty) * min(self.drawn, 1.0)
        # V = source - resistance * power / V; at most the power is drawn at which V is half of the source.
        voltage = 0.5 * (source + sqrt(max(0.0, source**2 - 4.0 * self.resistance * power)))
        self.electric_current = (source - voltage) / self.resistance
        self.drawn += self.electric_current * step_size / (3600.0 * self.capacity)
        self.sag = 1.0 - voltage / self.E_full
        return True
