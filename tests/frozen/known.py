"""Whole results: what is written for vehicles of every kind, and what commands print, each in a file of results/."""

import os
import re
from collections.abc import Callable
from contextlib import redirect_stdout
from difflib import unified_diff
from functools import partial
from io import StringIO
from math import isclose
from pathlib import Path
from unittest.mock import patch

from rov_fmu.bridges.sdf import gazebo_model
from rov_fmu.bridges.urdf import urdf_model
from rov_fmu.cli import main
from rov_fmu.fmu.content import native_content
from rov_fmu.fmu.osp import osp_model_description
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.bridges.test_sdf import IN_GAZEBO, LOADED
from tests.vehicles import EVERYTHING, OUTSIDE, THRUST_EFFECTS, VEHICLES, VIDEORAY, a_vehicle, pulsed

FOLDER = Path(__file__).parent / "results"
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_VARIES = re.compile(r'(?<= )(?:guid|instantiationToken|generationTool|generationDateAndTime)="[^"]*" ?')
"""What changes with every version, although nothing else does."""


def _described(vehicle: Vehicle, fmi: int) -> str:
    """Return what an FMU says of its vehicle: model description with the model card, terminals, and groups of OSP."""
    files = native_content(vehicle, fmi=fmi).files
    parts = [files["modelDescription.xml"], files["terminalsAndIcons/terminalsAndIcons.xml"]]
    text = b"\n".join([*parts, osp_model_description(vehicle.layout)]).decode()
    return _VARIES.sub("", text).replace("&#10;", "\n")


def _in_gazebo(vehicle: Vehicle, explicit: bool) -> str:
    return gazebo_model(vehicle, explicit=explicit).text


def _in_ros(vehicle: Vehicle) -> str:
    return urdf_model(vehicle).text


def _printed(command: str) -> str:
    """Return what a command prints without colours."""
    said = StringIO()
    with redirect_stdout(said), patch.dict(os.environ):
        for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
            os.environ.pop(name, None)
        assert main(command.split()) == 0
    return said.getvalue()


_VEHICLES = {
    "videoray": VIDEORAY,
    "everything": load_vehicle(EVERYTHING),
    "thrust_effects": pulsed(load_vehicle(THRUST_EFFECTS), (1100.0, 1480.0, 1900.0)),
    "surge_and_sway": a_vehicle(VEHICLES["surge and sway without yaw"]),
    "yaw_only": a_vehicle(VEHICLES["yaw only"]),
}
RESULTS: dict[str, Callable[[], str]] = {
    **{f"{name}.fmi2.xml": partial(_described, vehicle, 2) for name, vehicle in _VEHICLES.items()},
    "six_axes.fmi3.xml": partial(_described, OUTSIDE, 3),
    **{f"{name}.sdf": partial(_in_gazebo, *of) for name, of in IN_GAZEBO.items()},
    **{f"{name}.urdf": partial(_in_ros, LOADED[name]) for name in ("everything", "bluerov2_heavy", "remus100")},
    "tables.txt": partial(_printed, "tables videoray"),
    "simulate.txt": partial(_printed, "simulate videoray --set u_l=0.3 --set u_r=0.3 --set a_d_u=10 --set z=2"),
}
"""A function that makes each result anew, by the name of its file."""


def difference(name: str) -> list[str]:
    """Return the lines in which a result differs from the one that is kept. Numbers may differ by rounding."""
    path, now = FOLDER / name, RESULTS[name]().splitlines()
    kept = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    as_kept = [old if _same(old, new) else new for old, new in zip(kept, now, strict=False)] + now[len(kept) :]
    return [*unified_diff(kept, as_kept, "kept", "now", n=1, lineterm="")]


def _same(old: str, new: str) -> bool:
    """Return True if two lines have the same words, and numbers that differ by rounding."""
    if _NUMBER.sub("0", old) != _NUMBER.sub("0", new):
        return False
    pairs = zip(_NUMBER.findall(old), _NUMBER.findall(new), strict=True)
    return all(isclose(float(a), float(b), rel_tol=1e-9, abs_tol=1e-12) for a, b in pairs)
