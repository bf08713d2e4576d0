"""Collect the files of the FMU in pure Python, as the FmuBuilder of pythonfmu packs them."""

import json
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from pythonfmu import FmuBuilder

from rov_fmu.c.compile import PYTHONFMU_LIBRARY, compile_location
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.equation.printed import printed
from rov_fmu.fmu.variables import LOG_CATEGORIES, Variable
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.vehicle.vehicle import Vehicle

_SLAVE = Path(__file__).with_name("slave.py")
_STEP = Path(__file__).parents[1] / "equation" / "step.py"


def python_sources(vehicle: Vehicle, variables: tuple[Variable, ...]) -> Mapping[str, str]:
    """Return the files of this project in resources/ by name: the slave, the variables in JSON, the step, the equation.

    The modules are named after the vehicle, because all FMUs and the user's own code share one interpreter.
    """
    package, layout = f"{vehicle.identifier}_model", vehicle.layout
    declaration = {
        "identifier": vehicle.identifier,
        "log_categories": LOG_CATEGORIES,
        "commands": {name: delayed_name(name) for name in layout.commands} if layout.has_dead_time else {},
        "voltage_ranges": [[*bounds, curves] for bounds, curves in layout.voltage_ranges.items()],
        "variables": [asdict(v) for v in variables],
    }
    return {
        f"{vehicle.identifier}_slave.py": _text(_SLAVE).replace("rov_fmu.equation", package),
        "variables.json": json.dumps(declaration, ensure_ascii=False, indent=1) + "\n",
        f"{package}/step.py": _text(_STEP),
        f"{package}/equation.py": printed(layout, f"{package}.step"),
    }


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def python_files(vehicle: Vehicle, sources: Mapping[str, str]) -> dict[str, bytes]:
    """Return the files that FmuBuilder packs, by their path, except its modelDescription.xml.

    On Linux, another library is before that of PythonFMU.
    """
    with temporary_folder("fmu-") as folder:
        for name, text in sources.items():
            path = Path(folder, "sources", name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        script = Path(folder, "sources", f"{vehicle.identifier}_slave.py")
        project = [path for path in script.parent.iterdir() if path != script and path.name != "__pycache__"]
        with _imports_restored():
            built = FmuBuilder.build_FMU(script, dest=Path(folder, "built.fmu"), project_files=project)
        with zipfile.ZipFile(built) as archive:
            files = {
                name.replace("\\", "/"): archive.read(name)
                for name in archive.namelist()
                if name != "modelDescription.xml" and "__pycache__" not in name
            }
    library = f"binaries/linux64/{vehicle.identifier}.so"
    pythonfmu = files[library]
    return {**files, library: compile_location(pythonfmu), f"binaries/linux64/{PYTHONFMU_LIBRARY}": pythonfmu}


@contextmanager
def _imports_restored() -> Iterator[None]:
    """Restore sys.path and sys.modules, because FmuBuilder imports the slave and leaves it in both."""
    path, modules, bytecode = list(sys.path), set(sys.modules), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        yield
    finally:
        sys.path[:], sys.dont_write_bytecode = path, bytecode
        for name in set(sys.modules) - modules:
            del sys.modules[name]
