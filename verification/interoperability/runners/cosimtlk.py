"""cosimtlk, Co-Simulation."""

import cosimtlk

from verification.interoperability.runners.flight import FMU, OUTPUTS, fly, parameters

rov = cosimtlk.FMU(FMU).instantiate(start_time=0.0, step_size=0.1, start_values=parameters())


def outputs() -> list[float]:
    values = rov.read_outputs()
    return [values[name] for name in OUTPUTS]


fly(lambda step: rov.step(input_values=step.inputs), outputs)
rov.close()
