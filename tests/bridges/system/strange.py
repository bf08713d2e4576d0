"""An FMU for tests that fails, warns, returns NaN, hangs or ends its process from 0.5 s on, as its parameter says."""

import os
import time
from math import nan

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status


class Strange(Fmi2Slave):  # type: ignore[misc]
    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.kind = self.y = 0.0
        self.register_variable(Real("kind", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        if current_time >= 0.5:
            if self.kind == 1.0:
                self.log("the rope is cut", Fmi2Status.error)
                return False
            if self.kind == 2.0:
                raise ValueError("no rope")
            if self.kind == 3.0:
                self.y = nan
            if self.kind == 4.0:
                self.log("the rope is thin", Fmi2Status.warning)
            while self.kind == 5.0:
                time.sleep(0.1)
            if self.kind == 6.0:
                os.abort()
        return True
