"""PathSim, Co-Simulation: the FMU as a block between step sources and a scope."""

from pathsim import Connection, Simulation
from pathsim.blocks import Scope, StepSource
from pathsim_fmi import CoSimulationFMU

from interop.runners.flight import FMU, OUTPUTS, parameters, steps, write


def main() -> None:
    """Fly the manoeuvre."""
    flight = list(steps())
    rov = CoSimulationFMU(FMU, start_values=parameters(), dt=0.1)
    at_rest = [float(value) for value in rov.outputs.to_array()]
    times = [step.start for step in flight]
    sources = {name: StepSource([step.inputs[name] for step in flight], times) for name in flight[0].inputs}
    scope = Scope()
    simulation = Simulation(
        [*sources.values(), rov, scope],
        [
            *(Connection(source, rov[name]) for name, source in sources.items()),
            *(Connection(rov[name], scope[n]) for n, name in enumerate(OUTPUTS)),
        ],
        dt=0.1,
        log=False,
    )
    simulation.run(29.9)
    # The block takes its step when a period starts: from then on it shows the end of the period.
    shown = [at_rest, *scope.read()[1].T.tolist()]
    write([{"time": time, **dict(zip(OUTPUTS, values, strict=True))}
           for time, values in zip([0.0, *(step.end for step in flight)], shown, strict=True)])  # fmt: skip


if __name__ == "__main__":
    main()
