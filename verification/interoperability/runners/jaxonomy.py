"""Jaxonomy, Co-Simulation: the FMU as a block behind sources that hold the rows of the manoeuvre."""

from jaxonomy import DiagramBuilder, simulate
from jaxonomy.library import DataSource, ModelicaFMU

from verification.interoperability.runners.flight import FMU, OUTPUTS, parameters, steps, write

builder = DiagramBuilder()
# Without first_step_at_zero a step uses the inputs at its end.
rov = builder.add(ModelicaFMU(FMU, 0.1, parameters=parameters(), first_step_at_zero=True))
for name, port in zip(steps()[0].inputs, rov.input_ports, strict=True):
    source = DataSource(
        "manoeuvre.csv", column=name, header_as_first_row=True, time_samples_as_column=True, time_column="time"
    )
    builder.connect(builder.add(source).output_ports[0], port)
system = builder.build()
recorded = {port.name: port for port in rov.output_ports}
result = simulate(system, system.create_context(), (0.0, 30.0), recorded_signals=recorded)
write(zip(result.time.tolist(), *(result.outputs[name].tolist() for name in OUTPUTS), strict=True))
