"""SysSimX, Co-Simulation: the FMU as a component whose ports have units."""

from syssimx.components.fmu import FMUComponent

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, fly, parameters


def advance(step: Step) -> None:
    rov.set_inputs(step.inputs, t=step.start)
    rov.do_step(step.start, step.length)


def outputs() -> list[float]:
    """Return the magnitudes of the quantities in SI units, which are those of the FMU."""
    return [float(getattr(rov.outputs[name].get(), "magnitude", rov.outputs[name].get())) for name in OUTPUTS]


rov = FMUComponent("rov", FMU)
rov.set_parameters(**parameters())
rov.initialize(0.0)
fly(advance, outputs)
rov.free()
