"""FMPy, Co-Simulation: a slave stepped by hand, its state saved and restored on the way."""

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from interop.runners.flight import FMU, FULL, OUTPUTS, parameters, steps, write


def main() -> None:
    """Fly the manoeuvre."""
    description = read_model_description(FMU)
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    rov = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(FMU),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="rov",
    )

    def put(values: dict[str, float]) -> None:
        rov.setReal([reference[name] for name in values], list(values.values()))

    def outputs(time: float) -> dict[str, float]:
        return {"time": time, **dict(zip(OUTPUTS, rov.getReal([reference[name] for name in OUTPUTS]), strict=True))}

    rov.instantiate()
    rov.setupExperiment(startTime=0.0)
    put(parameters())
    rov.enterInitializationMode()
    rov.exitInitializationMode()
    result = [outputs(0.0)]
    for step in steps():
        if step.detour:
            state = rov.getFMUState()
            kept = rov.serializeFMUState(state)
            rov.freeFMUState(state)
            put(FULL)
            rov.doStep(currentCommunicationPoint=step.start, communicationStepSize=1.0)
            state = rov.deserializeFMUState(kept)
            rov.setFMUState(state)
            rov.freeFMUState(state)
        put(step.inputs)
        rov.doStep(currentCommunicationPoint=step.start, communicationStepSize=step.end - step.start)
        result.append(outputs(step.end))
    rov.terminate()
    rov.freeInstance()
    write(result)


if __name__ == "__main__":
    main()
