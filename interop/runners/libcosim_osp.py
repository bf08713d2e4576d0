"""libcosim, an OSP configuration: system structure and parameters from file."""

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level

from interop.runners.libcosim_cs import fly
from interop.runners.system import write_osp


def main() -> None:
    """Fly the manoeuvre."""
    log_output_level(CosimLogLevel.WARNING)
    write_osp("OspSystemStructure.xml")
    execution = CosimExecution.from_osp_config_file("OspSystemStructure.xml")
    fly(execution, execution.slave_index_from_instance_name("rov"))


if __name__ == "__main__":
    main()
