"""Whole results: what is written for vehicles of every kind, pages, and what commands print, in files of results/."""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rov_fmu.bridges.sdf import gazebo_model
from rov_fmu.bridges.urdf import urdf_model
from rov_fmu.cli import main
from rov_fmu.fmu.content import native_content
from rov_fmu.identify.result import Identification
from rov_fmu.interface.model import VehicleModel, load
from rov_fmu.interface.result import Result
from rov_fmu.report.console_results import print_identification
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.plots.drawing import draw_thrusters
from rov_fmu.report.plots.geometry import scenes
from rov_fmu.report.report import report_page
from rov_fmu.vehicle.shipped import VIDEORAY as VIDEORAY_FILE
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.bridges.test_sdf import IN_GAZEBO, LOADED, with_cross
from tests.commands import without_progress
from tests.frozen.comparison import differences
from tests.report.pages import check_is_whole, lines_of
from tests.report.results import bare, doubtful, example
from tests.vehicles import (
    EVERYTHING,
    HEAVY,
    OUTSIDE,
    SIX,
    THRUST_EFFECTS,
    VEHICLES,
    VIDEORAY,
    a_vehicle,
    pulsed,
)
from verification.tables import main as print_tables

HERE = Path(__file__).parent
FOLDER = HERE / "results"
LOGS = HERE / "logs"
_IDENTIFY = "identify {f} -o {f}.toml --report {f}.html"
_VARIES = re.compile(
    r'(?<= )(?:guid|instantiationToken|generationTool|generationDateAndTime)="[^"]*" ?'
    r"|(?<=rov-fmu )\d+\.\d+\.\d+(?:\.dev\d+\+[0-9a-f]+)?|\b[0-9a-f]{64}\b"
)
"""What changes with every version or with a source, although nothing else does."""


def _described(vehicle: Vehicle, fmi: int) -> str:
    """Return what an FMU says of its vehicle: model description with the model card, and terminals."""
    files = native_content(vehicle, fmi=fmi).files
    parts = [files["modelDescription.xml"], files["terminalsAndIcons/terminalsAndIcons.xml"]]
    text = b"\n".join(parts).decode()
    return text.replace("&#10;", "\n")


def _in_gazebo(vehicle: Vehicle, explicit: bool) -> str:
    return gazebo_model(vehicle, explicit=explicit).text


def _in_ros(vehicle: Vehicle) -> str:
    return urdf_model(vehicle).text


# ---- Pages -----------------------------------------------------------------------------------------------------------


def _plot(label: str, draw: Callable[[Figure], object], *_: Any, **__: Any) -> Markup:
    """Return what a plot shows, in words, because rendering takes most of the time."""
    draw(figure := Figure())
    lines = [label]
    for ax in figure.axes:
        scales = (scale.get_ylabel() for scale in ax.child_axes)
        lines.append("; ".join([ax.get_title(loc="left"), ax.get_xlabel(), ax.get_ylabel(), *scales]))
        for line in ax.lines:
            x, y = (np.asarray(part, float) for part in line.get_data())
            name = re.sub("^_.*", "line", str(line.get_label()))
            lines.append(f"{name}: {len(x)} from {_point(x, y, 0)} to {_point(x, y, -1)}, {_ends(y)}")
        for shape in (*ax.collections, *ax.patches):
            for x, y in [path.vertices.T for path in _paths(shape)]:
                lines.append(f"{type(shape).__name__}: {_ends(x)}, {_ends(y)}")
        lines.append(" ".join(text.get_text() for text in ax.texts))
    return Markup('<svg aria-label="{}"></svg>').format("\n".join(lines))


def _paths(shape: Any) -> list[Any]:
    """Return the outlines of a shape or a collection of shapes, in the coordinates of the data."""
    if isinstance(shape, Patch):
        return [shape.get_patch_transform().transform_path(shape.get_path())]
    return [*shape.get_paths()]


def _point(x: Any, y: Any, index: int) -> str:
    return f"({x[index]:.4g}, {y[index]:.4g})" if len(x) else "()"


def _ends(values: Any) -> str:
    return f"{np.nanmin(values):.4g} ... {np.nanmax(values):.4g}" if np.isfinite(values).any() else "nothing"


@contextmanager
def _without_plots(*more: str) -> Iterator[None]:
    """Replace the plots of pages by what they show, pictures by nothing, and the day by 23 November 2026."""
    with ExitStack() as patches:
        for module in ("report.report", "report.inspection_page", "report.page.fmu_page", *more):
            patches.enter_context(patch(f"rov_fmu.{module}.inline_svg", _plot))
        patches.enter_context(patch("rov_fmu.report.page.fmu_page.pictures", lambda _: {}))
        patches.enter_context(patch.dict(os.environ, SOURCE_DATE_EPOCH="1795392000"))
        yield


def _text(page: str) -> str:
    check_is_whole(page)
    return "\n".join(lines_of(page))


def _report(result: Callable[[], Identification]) -> str:
    """Return what the terminal and the report tell of an identification."""
    with _without_plots():
        page = _text(report_page(result()))
    return f"{_said(lambda: print_identification(result()))}\n{page}"


def _plots(*runs: Result) -> str:
    return "\n".join(line for run in runs for line in lines_of(_plot("", partial(run.plot, None))))


def _drawn(*vehicles: Vehicle) -> str:
    """Return where the texts and the ends of the arrows stand in the drawings of the thrusters of some vehicles."""
    lines = []
    for rov, (view, scene) in ((one, view) for one in vehicles for view in scenes(one).items()):
        draw_thrusters(ax := Figure(figsize=scene.inches).subplots(), rov, scene)
        for text in ax.texts:
            position = (*text.get_position(), *getattr(text, "xy", ()))
            lines.append(f"{rov.name} {view}: {text.get_text()} at {', '.join(f'{x:.4f}' for x in position)}")
    return "\n".join(lines)


def _page(vehicle: Vehicle, **how: Any) -> str:
    with _without_plots():
        return _text(documentation_page(vehicle, **how))


# ---- Commands --------------------------------------------------------------------------------------------------------


def _said(run: Callable[[], object]) -> str:
    """Return what is printed without colours."""
    said = StringIO()
    with redirect_stdout(said), redirect_stderr(said), patch.dict(os.environ, SOURCE_DATE_EPOCH="0"):
        for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
            os.environ.pop(name, None)
        run()
    return without_progress(said.getvalue())


def _printed(command: str, *more: str) -> str:
    return _said(lambda: main([*command.split(), *more]))


def _in_copy(folder: Path, options: str) -> str:
    """Return what a command prints about a copy of a folder, and what it writes beside it."""
    with TemporaryDirectory() as temporary, _without_plots():
        place = Path(temporary)
        shutil.copytree(folder, place / folder.name)
        said = _said(lambda: main([part.format(f=place / folder.name) for part in options.split()]))
        written = (path.read_text(encoding="utf-8") for path in sorted(place.glob("*.*")))
        parts = [said, *(_text(text.partition("\n")[2]) if text.startswith("<!") else text for text in written)]
        parts += [_text(documentation_page(load_vehicle(path))) for path in place.glob("*.toml")]
    return without_folder("\n".join(parts), temporary)


def without_folder(text: str, folder: str) -> str:
    """Return a text without the path of a folder. Commands to copy quote it if it has a space."""
    return re.sub(rf"'{re.escape(folder)}/([^']*)'", r"\1", text).replace(f"{folder}/", "")


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
    "cross_drag.urdf": partial(_in_ros, with_cross(LOADED["bluerov2"], b_d_uw=0.3)),
    "tables.txt": partial(_said, lambda: print_tables(["videoray"])),
    "simulate.txt": partial(_printed, "simulate videoray --set u_l=0.3 --set u_r=0.3 --set a_d_u=10 --set z=2"),
    "tune.txt": partial(_printed, "tune bluerov2_heavy --axis heave --command 0.5 --v-ss 0.4 --tau 0.3"),
    "tune_points.txt": partial(_printed, "tune videoray --axis heave --points", str(HERE / "csv" / "points.csv")),
    "plots.txt": lambda: _plots(
        load(VIDEORAY_FILE).simulate([0.0, 1.0, 2.0]),
        VehicleModel(**vars(a_vehicle(SIX))).simulate([0.0, 1.0, 2.0], {"N_ext": 1.0, "u_a": 0.2}),
        VehicleModel(**vars(a_vehicle(SIX))).simulate_many([0.0, 1.0], coefficients={"a_d_u": [8.0, 10.0]}),
    ),
    "drawings.txt": partial(_drawn, VIDEORAY, HEAVY, SIX),
    "page_videoray.txt": partial(_page, load_vehicle(VIDEORAY_FILE)),
    "page_heavy.txt": partial(_page, HEAVY, native=False),
    "page_pair.txt": partial(_page, a_vehicle(VEHICLES["lag without coupling"])),
    "page_six_axes.txt": partial(_page, a_vehicle(SIX), fmi=3),
    "report.txt": partial(_report, example),
    "report_of_little.txt": partial(_report, bare),
    "report_of_doubts.txt": partial(_report, doubtful),
    **{f"inspect_{path.name}.txt": partial(_in_copy, path, "inspect {f}") for path in LOGS.iterdir()},
    "inspection_page.txt": partial(_in_copy, LOGS / "dives", "inspect {f} --report {f}.html"),
    **{
        # The otter's loss of thrust with advance is hardly told: its interval ends elsewhere on each processor.
        f"identify_{path.name}.txt": partial(_in_copy, path, "identify {f}" if path.name == "otter" else _IDENTIFY)
        for path in (HERE / "tank_tests").iterdir()
        if path.name != "harbour"  # in its 20 s without noise, a hypothesis wins on one processor and loses on another
    },
}
"""A function that makes each result anew, by the name of its file."""
LONG = {f"identify_{name}.txt" for name in ("otter", "pool", "videoray_refit")}
"""Those that take more than a few seconds."""


def now(name: str) -> str:
    """Return a result of today without what varies."""
    return _VARIES.sub("", RESULTS[name]())


def difference(name: str, made: str) -> list[str]:
    """Return the lines in which a result differs from the one that is kept."""
    path = FOLDER / name
    kept = path.read_text(encoding="utf-8") if path.exists() else ""
    return differences(kept, made, is_fit=name.startswith("identify"))
