"""A current that varies, as a PythonFMU slave: a tide that sets in, with eddies across it."""

from math import cos, pi, sin

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

_PARAMETERS = {
    "speed": (0.25, "Largest speed of the tide (m/s)"),
    "direction": (-pi / 2, "Direction that the tide runs to (rad), from north to east"),
    "period": (80.0, "Time from slack water to slack water (s)"),
    "eddy_speed": (0.05, "Largest speed of the eddies (m/s)"),
    "eddy_period": (12.0, "Period of the eddies (s)"),
}


class Current(Fmi2Slave):  # type: ignore[misc]
    """The slave. It starts at slack water."""

    author = "rov-fmu"
    description = "A tide that sets in, with eddies across it"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=0.05)

    speed: float
    direction: float
    period: float
    eddy_speed: float
    eddy_period: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        for name, (start, text) in _PARAMETERS.items():
            setattr(self, name, start)
            variability = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
            self.register_variable(Real(name, description=text, **variability))
        for name, heading in (("V_N", "northward"), ("V_E", "eastward")):
            setattr(self, name, 0.0)
            text = f"Velocity of the current, {heading} (m/s)"
            self.register_variable(Real(name, description=text, causality=Fmi2Causality.output))

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Compute the current at the end of the step."""
        t = current_time + step_size
        tide = 0.5 * self.speed * (1.0 - cos(2.0 * pi * t / self.period))
        eddy = self.eddy_speed * sin(2.0 * pi * t / self.eddy_period)
        self.V_N = tide * cos(self.direction) - eddy * sin(self.direction)
        self.V_E = tide * sin(self.direction) + eddy * cos(self.direction)
        return True
