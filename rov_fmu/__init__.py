"""Make FMUs of identified underwater vehicles (ROVs): from tank tests to a vehicle file, and from that to an FMU.

    import rov_fmu

    vehicle = rov_fmu.load("videoray")
    run = vehicle.simulate([0.0, 5.0, 10.0], {"u_l": 0.3, "u_r": 0.3})
    print(run["u"])

`dir(rov_fmu)` lists what is public, and docs/api.md describes it. Everything else in the modules below is internal, and
may change with any version.
"""

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

# The public names. Each is imported when it is first used, because most need packages that take long to import.
if TYPE_CHECKING:
    from rov_fmu.bridges.gym import RovEnv, RovVectorEnv
    from rov_fmu.bridges.jacobian import StepJacobian, step_jacobian
    from rov_fmu.bridges.mujoco import load as load_mujoco
    from rov_fmu.build import Built
    from rov_fmu.build import build as build_fmu
    from rov_fmu.c.compile import BuildError, OptionError
    from rov_fmu.equation.alone import steady_velocity, time_constant
    from rov_fmu.equation.layout import Layout
    from rov_fmu.equation.parts import Curve, Thruster, VehicleAxis
    from rov_fmu.identify.findings import by_heading
    from rov_fmu.identify.inspection.inspected import Inspected
    from rov_fmu.identify.likelihood.kinds import PRIORS
    from rov_fmu.identify.result import (
        Answer,
        AxisResult,
        Coefficient,
        Disturbance,
        Effect,
        Identification,
        Logging,
        NextTest,
        Point,
        Prediction,
        SensorNoise,
        Slip,
        Verdict,
    )
    from rov_fmu.identify.tuning import Target, Tuning, TuningError, tune
    from rov_fmu.interface.identify_command import identify_folder
    from rov_fmu.interface.inspect_command import inspect_logs
    from rov_fmu.interface.model import VehicleModel
    from rov_fmu.interface.result import Result
    from rov_fmu.interface.stepper import VehicleStepper
    from rov_fmu.io.csv_table import DataFileError, UnreadableFileError
    from rov_fmu.io.messages import FileError, InputError, ProofError, RovError, StudyError, UnknownNameError
    from rov_fmu.io.output import WriteError
    from rov_fmu.prove.experiments import NoResultsError
    from rov_fmu.prove.proof import Finding
    from rov_fmu.prove.proof import prove as prove_fmu
    from rov_fmu.study.plan.plan import PlanError
    from rov_fmu.study.results.results import Results
    from rov_fmu.study.run.run_study import study as run_study
    from rov_fmu.vehicle.shipped import SHIPPED, find_vehicle
    from rov_fmu.vehicle.steady import Steady
    from rov_fmu.vehicle.uncertainty import Uncertainty
    from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
    from rov_fmu.vehicle.writer import write_tuned, write_vehicle

__all__ = [
    "PRIORS",
    "SHIPPED",
    "Answer",
    "AxisResult",
    "BuildError",
    "Built",
    "Coefficient",
    "Curve",
    "DataFileError",
    "Disturbance",
    "Effect",
    "FileError",
    "Finding",
    "Identification",
    "InputError",
    "Inspected",
    "Layout",
    "Logging",
    "NextTest",
    "NoResultsError",
    "OptionError",
    "PlanError",
    "Point",
    "Prediction",
    "ProofError",
    "Result",
    "Results",
    "RovEnv",
    "RovError",
    "RovVectorEnv",
    "SensorNoise",
    "Slip",
    "Steady",
    "StepJacobian",
    "StudyError",
    "Target",
    "Thruster",
    "Tuning",
    "TuningError",
    "Uncertainty",
    "UnknownNameError",
    "UnreadableFileError",
    "Vehicle",
    "VehicleAxis",
    "VehicleFileError",
    "VehicleModel",
    "VehicleStepper",
    "Verdict",
    "WriteError",
    "build_fmu",
    "by_heading",
    "find_vehicle",
    "identify_folder",
    "inspect_logs",
    "load",
    "load_mujoco",
    "load_vehicle",
    "prove_fmu",
    "run_study",
    "steady_velocity",
    "step_jacobian",
    "time_constant",
    "tune",
    "write_tuned",
    "write_vehicle",
]
__version__ = "0.2.0"


def load(vehicle: "str | Path | Vehicle") -> "VehicleModel":
    """Load a vehicle that ships, by its name, or a vehicle file, by its path.

    - `vehicle`: a name, a path, or a vehicle from elsewhere, such as that of an identification, which is returned
      with the functions of the result.

        rov_fmu.load("bluerov2").response("surge", 0.3)  # V_ss, m/s, and Tau, s, at 30 %

    Raises FileError, a ValueError, with one line for each mistake.
    """
    from rov_fmu.interface.model import load as load_model

    return load_model(vehicle)


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Import a public name (PEP 562)."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, there = homes()[name]
    return getattr(import_module(module), there)


@cache
def homes() -> dict[str, tuple[str, str]]:
    """Return the module of each public name, and its name there, as the imports at the top say. It is internal."""
    import ast

    nodes = ast.walk(ast.parse(Path(__file__).read_text(encoding="utf-8")))
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    found = {one.asname or one.name: (str(node.module), one.name) for node in imports for one in node.names}
    return {name: found[name] for name in __all__ if name in found}
