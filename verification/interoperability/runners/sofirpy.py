"""SOFiRpy, Co-Simulation."""

from pathlib import Path

from sofirpy.simulation.fmu import Fmu

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, fly, parameters


def advance(step: Step) -> None:
    for name, value in step.inputs.items():
        rov.set_parameter(name, value)
    rov.do_step(step.start)


rov = Fmu(Path(FMU), "rov", 0.1)
rov.initialize(parameters())
fly(advance, lambda: [rov.get_parameter_value(name) for name in OUTPUTS])
rov.conclude_simulation()
