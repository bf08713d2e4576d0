"""PathSim, Model Exchange: the FMU as a block integrated by one of PathSim's solvers."""

from pathsim import Connection, Simulation
from pathsim.blocks import Scope, StepSource
from pathsim.solvers import RKDP87
from pathsim_fmi import ModelExchangeFMU

from interop.runners.flight import FMU, OUTPUTS, parameters, steps, write


def main() -> None:
    """Fly the manoeuvre."""
    flight = list(steps())
    rov = ModelExchangeFMU(FMU, start_values=parameters())
    times = [step.start for step in flight]
    sources = {name: StepSource([step.inputs[name] for step in flight], times) for name in flight[0].inputs}
    scope = Scope(sampling_period=0.1)
    simulation = Simulation(
        [scope, *sources.values(), rov],  # the scope first: it is to look before the sources jump
        [
            *(Connection(source, rov[name]) for name, source in sources.items()),
            *(Connection(rov[name], scope[n]) for n, name in enumerate(OUTPUTS)),
        ],
        dt=0.01,
        Solver=RKDP87,
        tolerance_lte_rel=1e-8,
        tolerance_lte_abs=1e-9,
        log=False,
    )
    simulation.run(30.0)
    times, shown = scope.read()
    write([{"time": float(time), **dict(zip(OUTPUTS, values.tolist(), strict=True))}
           for time, values in zip(times, shown.T, strict=True)])  # fmt: skip


if __name__ == "__main__":
    main()
