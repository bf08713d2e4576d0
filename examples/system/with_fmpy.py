"""Run an SSP of Co-Simulation FMUs (FMI 2.0) in FMPy, with a fixed step: all pass on their outputs, then all step."""

from collections.abc import Iterator
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
from fmpy.ssp.ssd import read_ssd


def fly(ssp: str, step: float, steps: int) -> Iterator[dict[str, float]]:
    """Yield the outputs of all components at the end of each step, named as "rov.z"."""
    system, fmus = read_ssd(ssp).system, []
    get: dict[Any, Any] = {}
    put: dict[Any, Any] = {}

    def pass_on() -> None:
        """Give every connected input the value of its output, all at once."""
        ends = [(get[c.startElement, c.startConnector](), c.endElement, c.endConnector) for c in system.connections]
        for value, *end in ends:
            put[tuple(end)](value)

    with TemporaryDirectory() as folder:
        fmpy.extract(ssp, folder)
        for component in system.elements:
            file = f"{folder}/{component.source}"
            description = fmpy.read_model_description(file)
            fmu = fmpy.instantiate_fmu(fmpy.extract(file, f"{folder}/{component.name}"), description, "CoSimulation")
            calls = {
                "Real": (fmu.getReal, fmu.setReal, float),
                "Boolean": (fmu.getBoolean, fmu.setBoolean, "true".__eq__),
            }
            for v in description.modelVariables:
                read, write, kind = calls[v.type]
                get[component.name, v.name] = lambda read=read, v=v: read([v.valueReference])[0]
                put[component.name, v.name] = lambda x, write=write, v=v, kind=kind: write(
                    [v.valueReference], [kind(x)]
                )
            fmu.setupExperiment(startTime=0.0)
            for binding in component.parameterBindings:
                for parameter in binding.parameterValues[0].parameters:
                    put[component.name, parameter.name](parameter.value)
            fmu.enterInitializationMode()
            fmus.append(fmu)
        for _ in fmus:  # outputs that follow inputs are right at the start
            pass_on()
        for fmu in fmus:
            fmu.exitInitializationMode()
        outputs = [(e.name, c.name) for e in system.elements for c in e.connectors if c.kind == "output"]
        for n in range(steps):
            pass_on()
            for fmu in fmus:
                fmu.doStep(n * step, step)
            yield {f"{component}.{name}": get[component, name]() for component, name in outputs}
