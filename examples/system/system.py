"""The system as files: four FMUs; an SSP archive for each vehicle."""

import subprocess
import sys
from collections.abc import Mapping
from math import pi
from pathlib import Path

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import autopilot_fmu
from rov_fmu.bridges.system.companion import companion
from rov_fmu.bridges.system.companions.battery import Battery
from rov_fmu.bridges.system.connections import Connection
from rov_fmu.bridges.system.ssp import Component, System, ssp_content
from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

from .current import Current

HERE = Path(__file__).parent
STOP = 60.0  # s
STEP = 0.05  # s, between two communication points
STEPS = round(STOP / STEP)

DEFAULT = "videoray"
IDENTIFIED = "videoray_refit"

Values = Mapping[str, float | bool]

# The set points, and as much forward stick as holds the place against current and tether.
MISSION: Values = {"mode_w": 2.0, "ref_z": 5.0, "mode_r": 2.0, "ref_psi": pi / 2, "stick_u": 0.09}
# The tether pulls aft, up and to starboard. The current runs westward, at the bow after the turn.
TETHER: Values = {"X_ext": -2.0, "Z_ext": -1.5, "N_ext": 0.05}

# From output to input. What is not connected keeps the value of the parameter set.
CONNECTIONS = {
    ("rov", "z"): ("autopilot", "z"),
    ("rov", "psi"): ("autopilot", "psi"),
    ("rov", "r"): ("autopilot", "r"),
    ("rov", "vg_D"): ("autopilot", "vg_D"),
    ("autopilot", "u_l"): ("rov", "u_l"),
    ("autopilot", "u_r"): ("rov", "u_r"),
    ("autopilot", "u_t"): ("rov", "u_t"),
    ("current", "V_N"): ("rov", "V_N"),
    ("current", "V_E"): ("rov", "V_E"),
    ("rov", "F_l"): ("battery", "F_l"),
    ("rov", "F_r"): ("battery", "F_r"),
    ("rov", "F_t"): ("battery", "F_t"),
    ("battery", "sag"): ("autopilot", "sag"),
}

SLAVES: dict[str, type] = {"current": Current, "battery": Battery}
FMUS = {
    "rov": "videoray.fmu",
    "autopilot": "videoray_autopilot.fmu",
    **{name: f"{slave.__name__}.fmu" for name, slave in SLAVES.items()},
}
OUTPUTS = {
    "rov": ("x", "y", "z", "psi", "u", "w", "r", "F_l", "F_r", "F_t", "vg_D"),
    "current": ("V_N", "V_E"),
    "battery": ("sag", "drawn", "electric_current"),
    "autopilot": ("u_l", "u_r", "u_t"),
}


def parameter_sets() -> dict[str, dict[str, Values]]:
    """Name of a vehicle to the values of each component. The FMU of the VideoRay takes those of the identified one."""
    vehicles = {name: load_vehicle(SHIPPED[name]).coefficients for name in (DEFAULT, IDENTIFIED)}
    others: dict[str, Values] = {"current": {}, "battery": {}, "autopilot": MISSION}
    return {name: {"rov": {**values, **TETHER}, **others} for name, values in vehicles.items()}


def system_file(folder: Path, parameters: str) -> Path:
    """The SSP archive of a parameter set, which is a system of its own: tools open one .ssd an archive."""
    return folder / f"{parameters}.ssp"


def build_system(folder: Path) -> None:
    """Write all files. Raises RuntimeError where an FMU cannot be built."""
    folder.mkdir(parents=True, exist_ok=True)
    if main(["build", "--platform", "host", "-o", str(folder / "videoray.fmu")]):
        raise RuntimeError("videoray.fmu was not built")
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", str(HERE / "current.py"), "-d", str(folder)]
    subprocess.run(build, check=True)
    (folder / FMUS["battery"]).write_bytes(companion("battery"))
    held = autopilot_of(load_vehicle(SHIPPED[DEFAULT]), STEP)
    (folder / FMUS["autopilot"]).write_bytes(autopilot_fmu(held, ["host"]))
    for parameters, values in parameter_sets().items():
        # Only connected inputs are connectors, for FMPy sets every one of them at every step.
        components = {
            name: Component(
                fmu,
                (folder / fmu).read_bytes(),
                values[name],
                [v for c, v in CONNECTIONS.values() if c == name],
                OUTPUTS[name],
            )
            for name, fmu in FMUS.items()
        }
        connections = [Connection(*ends) for ends in CONNECTIONS.items()]
        system = System("dive", components, STEP, STOP, connections)
        system_file(folder, parameters).write_bytes(ssp_content(system))
