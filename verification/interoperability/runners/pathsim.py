"""PathSim-FMI, with PathSim: the FMU is a block between step sources and a scope.

cs: Co-Simulation; me: Model Exchange with one of PathSim's solvers.
"""

import sys
from typing import Any

from pathsim import Connection, Simulation
from pathsim.blocks import Scope, StepSource
from pathsim.solvers import RKDP87
from pathsim_fmi import CoSimulationFMU, ModelExchangeFMU

from verification.interoperability.runners.flight import FMU, OUTPUTS, parameters, steps, write

flight = steps()
rov: Any
options: dict[str, Any]
if sys.argv[1] == "cs":
    rov = CoSimulationFMU(FMU, start_values=parameters(), dt=0.1)
    at_rest = [float(value) for value in rov.outputs.to_array()]
    scope, end, options = Scope(), 29.9, {"dt": 0.1}
else:
    rov = ModelExchangeFMU(FMU, start_values=parameters())
    scope, end = Scope(sampling_period=0.1), 30.0
    options = {"dt": 0.01, "Solver": RKDP87, "tolerance_lte_rel": 1e-8, "tolerance_lte_abs": 1e-9}
sources = {
    name: StepSource([step.inputs[name] for step in flight], [step.start for step in flight])
    for name in flight[0].inputs
}
simulation = Simulation(
    [scope, *sources.values(), rov],  # the scope comes first, so that it samples before the sources jump
    [
        *(Connection(source, rov[name]) for name, source in sources.items()),
        *(Connection(rov[name], scope[n]) for n, name in enumerate(OUTPUTS)),
    ],
    log=False,
    **options,
)
simulation.run(end)
times, shown = (values.T.tolist() for values in scope.read())
if sys.argv[1] == "cs":  # the block steps at the start of a period, and from then on shows the outputs at its end
    times, shown = [0.0, *(step.end for step in flight)], [at_rest, *shown]
write([time, *values] for time, values in zip(times, shown, strict=True))
