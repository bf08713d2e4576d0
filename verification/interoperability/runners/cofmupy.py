"""CoFmuPy, Co-Simulation: a system of one FMU from a JSON file, its inputs as literal streams."""

import json
from pathlib import Path

from cofmupy import Coordinator

from verification.interoperability.runners.flight import FMU, OUTPUTS, fly, parameters, steps

streams = {  # half a step early, because its clock adds up the steps and drifts
    name: {str(step.start - 0.05): step.inputs[name] for step in steps()} for name in steps()[0].inputs
}
Path("system.json").write_text(
    json.dumps(
        {
            "fmus": [{"id": "rov", "path": FMU, "initialization": parameters()}],
            "connections": [
                {"source": {"type": "literal", "values": values}, "target": {"id": "rov", "variable": name}}
                for name, values in streams.items()
            ],
        }
    )
)
coordinator = Coordinator()
coordinator.start("system.json")
fly(
    lambda step: coordinator.do_step(step.length),
    lambda: [coordinator.get_variable(("rov", name))[0] for name in OUTPUTS],
)
