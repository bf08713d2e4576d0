"""A small, worn battery as a PythonFMU slave: the thrusters draw power, and the voltage sags.

The power of a propeller is proportional to thrust^1.5 (the theory of the actuator disc). The battery is a source of
voltage, which falls with the charge, behind a resistance.
"""

from math import sqrt

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

_INPUTS = {name: f"Thrust {name} (N)" for name in ("F_l", "F_r", "F_t")}
_OUTPUTS = {
    "sag": "Drop of the voltage relative to a full battery without load (1)",
    "drawn": "Share of the capacity that has been drawn (1)",
    "electric_current": "Electric current (A)",
}
_PARAMETERS = {
    "E_full": (25.2, "Voltage of a full battery without load (V)"),
    "E_empty": (21.0, "Voltage of an empty battery without load (V)"),
    "capacity": (0.15, "Capacity (A.h)"),
    "resistance": (1.0, "Internal resistance (Ohm)"),
    "hotel_load": (80.0, "Power of camera, lights and electronics (W)"),
    "k_P": (0.9, "Electric power of a propeller over thrust^1.5 (W/N^1.5)"),
}


class Battery(Fmi2Slave):  # type: ignore[misc]
    """The slave. It starts full, without load."""

    author = "rov-fmu"
    description = "A battery: from thrusts to the drop of the voltage"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=0.05)

    drawn: float
    E_full: float
    E_empty: float
    capacity: float
    resistance: float
    hotel_load: float
    k_P: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        starts = {name: (0.0, text) for name, text in (_INPUTS | _OUTPUTS).items()} | _PARAMETERS
        for name, (start, text) in starts.items():
            setattr(self, name, start)
            kind = {"causality": Fmi2Causality.output}
            if name in _INPUTS:
                kind = {"causality": Fmi2Causality.input}
            elif name in _PARAMETERS:
                kind = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
            self.register_variable(Real(name, description=text, **kind))

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Draw the power of the thrusts over the step."""
        power = self.hotel_load + self.k_P * sum(abs(getattr(self, name)) ** 1.5 for name in _INPUTS)
        source = self.E_full - (self.E_full - self.E_empty) * min(self.drawn, 1.0)
        # V = source - resistance * power / V; at most the power is drawn at which V is half of the source.
        voltage = 0.5 * (source + sqrt(max(0.0, source**2 - 4.0 * self.resistance * power)))
        self.electric_current = (source - voltage) / self.resistance
        self.drawn += self.electric_current * step_size / (3600.0 * self.capacity)
        self.sag = 1.0 - voltage / self.E_full
        return True
