"""Ecos, Co-Simulation: a structure of one ROV, its parameters as a named set."""

from ecospy import EcosSimulation, EcosSimulationStructure

from interop.runners.flight import FMU, OUTPUTS, parameters, steps, write


def main() -> None:
    """Fly the manoeuvre."""
    with EcosSimulationStructure() as structure:
        structure.add_model("rov", FMU)
        structure.add_parameter_set("manoeuvre", {f"rov::{name}": value for name, value in parameters().items()})
        with EcosSimulation(structure=structure, step_size=0.1) as simulation:
            simulation.init(parameter_set="manoeuvre")
            fly(simulation)
            simulation.terminate()


def fly(simulation: EcosSimulation) -> None:
    """Step a system with a model named rov in it, and write what the ROV does."""

    def outputs(time: float) -> dict[str, float]:
        return {"time": time, **{name: simulation.get_real(f"rov::{name}") for name in OUTPUTS}}

    result = [outputs(0.0)]
    for step in steps():
        for name, value in step.inputs.items():
            simulation.set_real(f"rov::{name}", value)
        simulation.step()
        result.append(outputs(step.end))
    write(result)


if __name__ == "__main__":
    main()
