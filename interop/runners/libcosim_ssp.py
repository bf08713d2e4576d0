"""libcosim, an SSP archive: system structure and parameters from file."""

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level

from interop.runners.libcosim_cs import fly
from interop.runners.system import write_ssp


def main() -> None:
    """Fly the manoeuvre."""
    log_output_level(CosimLogLevel.WARNING)
    write_ssp("dive.ssp")
    execution = CosimExecution.from_ssp_file("dive.ssp", 100_000_000)  # ns
    fly(execution, execution.slave_index_from_instance_name("rov"))


if __name__ == "__main__":
    main()
