"""The system of ROV and autopilot as files: two FMUs; an SSP archive and an OSP configuration a parameter set."""

import shutil
import subprocess
import sys
from collections.abc import Mapping
from math import pi
from pathlib import Path

from examples.systems import Component, System, write_osp, write_ssp
from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

HERE = Path(__file__).parent
STOP = 60.0  # s
STEP = 0.05  # s, between two communication points
STEPS = round(STOP / STEP)

DEFAULT = "table9"

Values = Mapping[str, float | bool]

# The set points, and as much forward stick as holds the place against current and tether.
MISSION: Values = {"z_ref": 5.0, "psi_ref": pi / 2, "surge": 0.26, "depth_hold": True, "heading_hold": True}
# The tether pulls aft, up and to starboard; the current runs westward, at the bow after the turn.
SEA: Values = {"X_ext": -2.0, "Z_ext": -1.5, "N_ext": 0.05, "V_E": -0.2}

# From output to input. What is not connected keeps the value of the parameter set.
CONNECTIONS = {
    ("rov", "z"): ("autopilot", "z"),
    ("rov", "psi"): ("autopilot", "psi"),
    ("autopilot", "u_l"): ("rov", "u_l"),
    ("autopilot", "u_r"): ("rov", "u_r"),
    ("autopilot", "u_t"): ("rov", "u_t"),
}
# The same by the groups of the OSP model descriptions.
GROUPS = ("depth", "heading", "thruster_commands")

FMUS = {"rov": "videoray.fmu", "autopilot": "Autopilot.fmu"}
OUTPUTS = {
    "rov": ("x", "y", "z", "psi", "u", "w", "r"),
    "autopilot": ("u_l", "u_r", "u_t", "z_d", "psi_d"),
}


def parameter_sets() -> dict[str, dict[str, Values]]:
    """Name to the values of each component: Table 9, and the same with α = β = 1."""
    table9 = dict(load_vehicle(VIDEORAY).coefficients)
    untuned = {name: 1.0 if name.startswith(("alpha", "beta")) else value for name, value in table9.items()}
    return {
        DEFAULT: {"rov": {**table9, **SEA}, "autopilot": MISSION},
        "alpha_beta_1": {"rov": {**untuned, **SEA}, "autopilot": MISSION},
    }


def system_files(folder: Path, parameters: str) -> tuple[Path, Path]:
    """The SSP archive and the OSP configuration of a parameter set; what tools look for holds the default one.

    A parameter set is a system of its own: of several, tools take another one each, and they open one .ssd an archive.
    """
    suffix = "" if parameters == DEFAULT else f"_{parameters}"
    return folder / f"videoray{suffix}.ssp", folder / f"OspSystemStructure{suffix}.xml"


def build_system(folder: Path) -> None:
    """Write all files. Raises RuntimeError where an FMU cannot be built."""
    folder.mkdir(parents=True, exist_ok=True)
    if main(["build", "--platform", "host", "--osp", "-o", str(folder / "videoray.fmu")]):
        raise RuntimeError("videoray.fmu was not built")
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", str(HERE / "autopilot.py"), "-d", str(folder)]
    subprocess.run(build, check=True)
    shutil.copy(HERE / "Autopilot_OspModelDescription.xml", folder)
    for parameters, values in parameter_sets().items():
        # Only connected inputs are connectors, for FMPy sets every one of them at every step.
        components = {
            name: Component(
                folder / fmu, values[name], [v for c, v in CONNECTIONS.values() if c == name], OUTPUTS[name]
            )
            for name, fmu in FMUS.items()
        }
        system = System("station_keeping", components, STEP, STOP, CONNECTIONS, GROUPS)
        ssp, osp = system_files(folder, parameters)
        write_ssp(ssp, system)
        write_osp(osp, system)
