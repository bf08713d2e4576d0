"""Ecos, an SSP archive: system structure and parameters from file."""

from ecospy import EcosSimulation

from interop.runners.ecos_cs import fly
from interop.runners.system import write_ssp


def main() -> None:
    """Fly the manoeuvre."""
    write_ssp("dive.ssp")
    with EcosSimulation(ssp_path="dive.ssp", step_size=0.1) as simulation:
        simulation.init(parameter_set="manoeuvre")
        fly(simulation)
        simulation.terminate()


if __name__ == "__main__":
    main()
