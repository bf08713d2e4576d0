"""Make FMUs of identified underwater vehicles (ROVs): from tank tests to a vehicle file, and from that to an FMU.

    import rov_fmu

    vehicle = rov_fmu.load("videoray")
    run = vehicle.simulate([0.0, 5.0, 10.0], {"u_l": 0.3, "u_r": 0.3})
    print(run["u"])

`dir(rov_fmu)` lists what is public, and docs/api-in-full.rst has the same by subject. Everything else in the modules
below is internal, and may change with any version.
"""

from importlib import import_module
from typing import Any

__version__ = "0.3.0.dev0"
HOMES = {
    name: f"rov_fmu.{module}"
    for module, names in {
        "bridges.gym": "RovEnv RovVectorEnv",
        "bridges.mujoco": "load_mujoco",
        "build": "Built build_fmu",
        "c.compile": "BuildError OptionError",
        "equation.alone": "steady_velocity time_constant",
        "equation.layout": "Coefficient Layout",
        "equation.parts": "Curve Point Thruster VehicleAxis",
        "identify.findings": "by_heading",
        "identify.inspection.inspected": "Inspected",
        "identify.likelihood.kinds": "PRIORS",
        "identify.result": "Answer AxisResult Disturbance Identification IdentifiedCoefficient IdentifiedEffect "
        "Logging MeasuredPoint Prediction SensorNoise Slip Verdict",
        "identify.tuning": "Target Tuning TuningError tune",
        "interface.identify_command": "identify_folder",
        "interface.inspect_command": "inspect_logs",
        "interface.model": "VehicleModel load",
        "interface.result": "Result",
        "interface.stepper": "VehicleStepper",
        "io.csv_table": "DataFileError UnreadableFileError",
        "io.messages": "FileError InputError ProofError RovError StudyError UnknownNameError",
        "io.output": "WriteError",
        "prove.experiments": "NoResultsError",
        "prove.proof": "ProofFinding prove_fmu",
        "study.plan": "PlanError",
        "study.results": "Results",
        "study.run": "run_study",
        "tank.findings": "Finding",
        "vehicle.shipped": "SHIPPED find_vehicle",
        "vehicle.steady": "Steady",
        "vehicle.uncertainty": "Uncertainty",
        "vehicle.vehicle": "Vehicle VehicleFileError VehicleWarning load_vehicle",
        "vehicle.writer": "write_tuned write_vehicle",
    }.items()
    for name in names.split()
}
"""The module of each public name. It is imported when the name is first used, because most need packages that take
long. The table is internal."""
__all__ = sorted(HOMES)  # noqa: PLE0605 (type checkers read __init__.pyi)


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Import a public name (PEP 562)."""
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(HOMES[name]), name)
