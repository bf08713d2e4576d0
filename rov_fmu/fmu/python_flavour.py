"""Collect the files of the FMU in pure Python, as the FmuBuilder of pythonfmu packs them."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import pythonfmu

from rov_fmu.c.compile import PYTHONFMU_LIBRARY, compile_location
from rov_fmu.equation.python import step
from rov_fmu.equation.python.printed import printed
from rov_fmu.equation.words import AFLOAT, LEFT_WATER
from rov_fmu.fmu.variables import LOG_CATEGORIES, DeclaredVariable
from rov_fmu.vehicle.vehicle import Vehicle

_SLAVE = Path(__file__).with_name("slave.py")
_STEP = Path(step.__file__).parent


def python_sources(vehicle: Vehicle, variables: tuple[DeclaredVariable, ...]) -> Mapping[str, str]:
    """Return the files of this project in resources/ by name: the slave, the variables in JSON, the step, the equation.

    The modules are named after the vehicle, because all FMUs and the user's own code share one interpreter.
    """
    package, layout = f"{vehicle.identifier}_model", vehicle.layout
    declaration = {
        "identifier": vehicle.identifier,
        "log_categories": LOG_CATEGORIES,
        "commands": layout.acting,
        "before": layout.before,
        "left_water": [AFLOAT, LEFT_WATER] if layout.has_only_water else None,
        "voltage_ranges": [[*bounds, curves] for bounds, curves in layout.voltage_ranges.items()],
        "variables": [asdict(v) for v in variables],
    }
    return {
        f"{vehicle.identifier}_slave.py": _text(_SLAVE).replace("rov_fmu.equation.python", package),
        "variables.json": json.dumps(declaration, ensure_ascii=False, indent=1) + "\n",
        **{f"{package}/{name}": _text(_STEP / name) for name in ("step.py", "dop853.py")},
        f"{package}/equation.py": printed(layout, f"{package}.step"),
    }


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def python_files(identifier: str, sources: Mapping[str, str]) -> dict[str, bytes]:
    """Return the files that FmuBuilder of pythonfmu would pack, by their path, except its modelDescription.xml.

    The slave is the class in <identifier>_slave.py, one of the sources.

    FmuBuilder itself would import the slave into this process. On Linux, another library is before that of PythonFMU.
    """
    package = Path(pythonfmu.__file__).parent
    files = {f"resources/{name}": text.encode() for name, text in sources.items()}
    files |= {f"resources/pythonfmu/{path.name}": path.read_bytes() for path in package.glob("*.py")}
    files["resources/slavemodule.txt"] = f"{identifier}_slave".encode()
    for path in (package / "resources" / "binaries").glob("*/*pythonfmu-export.*"):
        files[f"binaries/{path.parent.name}/{identifier}{path.suffix}"] = path.read_bytes()
    library = f"binaries/linux64/{identifier}.so"
    return {**files, library: compile_location(files[library]), f"binaries/linux64/{PYTHONFMU_LIBRARY}": files[library]}
