"""The page of `rov-fmu inspect` shows all of a log over one time, which thruster moves what, and what comes next."""

import json
from pathlib import Path

import numpy as np
import pytest
from lxml import html
from matplotlib.figure import Figure

from rov_fmu.cli import main
from rov_fmu.identify.inspection.inspected import inspect_paths
from rov_fmu.report.inspection_page import inspection_page
from rov_fmu.report.plots.logs import plot_log
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.report.pages import rows, text_of
from tests.tank.logs import channel, commands, log
from tests.tank.readers.motion import DIVE, THRUSTERS, TIME
from tests.tank.readers.writers import LOGS, table

BLUEROV2 = load_vehicle(SHIPPED["bluerov2"])


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of a dive of six thrusters, which are those of the BlueROV2."""
    return inspection_page(inspect_paths([LOGS[".tlog"](tmp_path_factory.mktemp("dive"), DIVE)]))


def test_commands_and_measurements_have_panels_of_one_size_over_one_time(page: str) -> None:
    for width in ("broad", "narrow"):
        marks = map(json.loads, html.fromstring(page).xpath(f"//div[@class='{width}']//@data-plot"))
        panels = [mark for mark in marks if mark.get("title")]
        assert {"Depth (m)", "Commands (%)"} <= {panel["title"] for panel in panels}
        assert len({tuple(panel["x"]) for panel in panels}) == 1
        heights = [bottom - top for _, top, _, bottom in (panel["box"] for panel in panels)]
        assert max(heights) == pytest.approx(min(heights), rel=0.02)


def test_a_clock_that_counts_from_1970_is_drawn_from_the_first_command() -> None:
    time = 1.777e9 + TIME
    figure = Figure()
    plot_log(figure, log(commands(time, THRUSTERS), channel("depth", time, DIVE.position[:, 2])))
    for ax in figure.axes:
        assert ax.get_xlim()[0] == pytest.approx(0.0, abs=0.05 * np.ptp(TIME))
        assert ax.get_xlim()[1] == pytest.approx(np.ptp(TIME), rel=0.1)


def test_each_thruster_moves_the_model_as_the_page_says(page: str) -> None:
    rest, state = dict.fromkeys(BLUEROV2.layout.inputs, 0.0), dict.fromkeys(BLUEROV2.layout.state, 0.0)
    still = BLUEROV2.step(rest, state, 0.1)
    ends = {name: BLUEROV2.step(rest | {f"u_{name}": 0.5}, state, 0.1) for name in THRUSTERS}
    for motion, velocity in {"Forward": "u", "To starboard": "v", "Down": "w", "Bow to starboard": "r"}.items():
        _, *told = next(row for row in rows(page) if row[0] == motion)
        for sign, names in zip((1.0, -1.0), told, strict=True):
            moved = [name for name in THRUSTERS if sign * (ends[name][velocity] - still[velocity]) > 1e-6]
            assert names == (", ".join(moved) or "\N{EN DASH}"), motion


@pytest.mark.parametrize("kind", ["a dive", "no commands", "a vehicle of one's own", "refused", "a draft"])
def test_the_page_names_the_next_step_that_the_terminal_names(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        "rov_fmu.report.inspection_page.inline_svg", lambda *_, **__: ""
    )  # which takes most of the time
    folder = tmp_path / "dives"
    folder.mkdir()
    if kind == "no commands":
        table(folder / "a.csv", "time [s],depth [m]", TIME, DIVE.position[:, 2])
    elif kind == "a vehicle of one's own":
        table(folder / "a.csv", "time [s],u_bow [%],depth [m]", TIME, 100.0 * THRUSTERS["1"], DIVE.position[:, 2])
    else:
        LOGS[".tlog"](folder, DIVE)
    if kind == "refused":
        (folder / "rov.toml").write_text('base = "videoray"\n', encoding="utf-8")
    options = ["--draft"] if kind == "a draft" else []
    assert main(["inspect", str(folder), "--report", str(tmp_path / "page.html"), *options]) == 0
    _, _, step = " ".join(capsys.readouterr().out.split()).rpartition("Next: ")
    assert f"Next: {step} " in text_of((tmp_path / "page.html").read_text(encoding="utf-8"))
