"""`rov-fmu fly --recording`: logs of every format beside the model, on a timeline, with bands and unknown forces."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import html

from rov_fmu import load
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import AXES
from rov_fmu.report.page.live import FlyingVehicle, fly_page
from rov_fmu.report.page.recording import recording_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import spread
from tests.report.conftest import Visit, chart, flown_vehicle, until
from tests.report.test_live import a_recording
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import LOGS


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    """The log of a flight of the model itself, with a header that only rov.toml explains."""
    path = tmp_path / "dive.csv"
    path.write_text(a_recording().replace("depth [m]", "tiefe"), encoding="utf-8")
    (tmp_path / "rov.toml").write_text('[columns]\n"tiefe" = "depth [m]"\n', encoding="utf-8")
    return path


@pytest.fixture
def replay(tmp_path: Path, fly: Callable[..., Any]) -> Callable[..., Any]:
    """A function that opens the page of a log and pauses it."""

    def page(log: Path, *options: str, vehicle: str = "videoray") -> Any:
        target = tmp_path / "page.html"
        assert main(["fly", vehicle, "--recording", str(log), *options, "-o", str(target)]) == 0
        page = fly(target.as_uri())
        page.evaluate("live.pause(true)")
        return page

    return page


def test_the_page_of_a_recording_says_what_was_flown(csv: Path, vehicle: Vehicle) -> None:
    page = html.fromstring(fly_page([FlyingVehicle(vehicle, b"")], recording=recording_of(csv, vehicle)))
    assert page.findtext(".//title") == page.findtext(".//h1") == "dive.csv, flown by VideoRay Pro 4"
    _, *rows = csv.read_text("utf-8").splitlines()
    end, *commands = np.array([row.split(",")[:4] for row in rows], float).T
    assert f"{end[-1]:.3g} s of recorded commands, at most {np.abs(commands).max():.0f} %." in page.findtext(
        ".//header/p"
    )


ERRORS = """live.flight.replay.errors.map((list) => [list.slice(0, 100), list.slice(100)].map(
    (some) => Math.max(...some.map(Math.abs))))"""
"""The largest error along each axis, at 10 Hz before and after the prediction begins anew."""


@pytest.mark.parametrize(
    ("text", "options", "reason"),
    [
        ("time [s],depth [m]\n0,1\n1,2\n", ["--recording", "dive.csv"], "there is no column of commands"),
        ("time [s],u_l [%]\n0,1\n1,2\n", ["--recording", "dive.csv"], "is missing"),
        ("time [s],u_l [%],depth [m]\n0,9,\n1,9,\n2,9,\n", ["--recording", "dive.csv"], "no motion of an axis of this"),
    ],
)
def test_a_log_that_cannot_be_flown_is_refused_in_one_line(
    text: str,
    options: list[str],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dive.csv").write_text(text, encoding="utf-8")
    assert main(["fly", "videoray", *options, "-o", "page.html"]) == 2
    assert reason in " ".join(capsys.readouterr().err.split())
    assert not Path("page.html").exists()


@pytest.mark.interop
def test_the_timeline_goes_to_any_time_and_the_charts_show_the_error(
    csv: Path, replay: Callable[..., Any], vehicle: Vehicle
) -> None:
    page = replay(csv)
    assert page.locator("#live-timeline").is_visible()
    assert page.input_value("#live-view") == "measured"
    pieces = page.evaluate(ERRORS)
    assert len(pieces) == 3
    assert max(first for first, _ in pieces) < 1e-8, "the recording is that of the model"
    assert max(again for _, again in pieces) < 0.3, "the velocity at the second begin is that of the measured way"
    _, depth, _ = recording_of(csv, vehicle)["signals"]
    depths = dict(zip(depth["times"], depth["values"], strict=True))
    for time in (15.0, 3.0, 19.9, 0.0):
        page.evaluate(
            "(t) => { const one = document.getElementById('live-timeline'); one.value = t;"
            " one.dispatchEvent(new Event('input')); live.draw(); }",
            time,
        )
        shown = page.evaluate("[live.flight.pilot, live.flight.ghost].map(({ model }) => model.get('z'))")
        assert shown[0] == pytest.approx(depths[time], abs=1e-6 if time < 10.0 else 0.1)
        assert shown[1] == pytest.approx(depths[time], abs=1e-6)
        assert time > 10.0 or "error 0.00" in chart(page, "heave")["words"].replace("\N{MINUS SIGN}", "")
    page.select_option("#live-view", "error")
    until(page, "!live.changed")
    assert page.locator("#live-charts canvas").count() == 3
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.replay === null")
    assert not page.locator("#live-timeline").is_visible(), "the pilot has control"


@pytest.mark.interop
def test_a_recording_with_a_deck_begins_anew_where_it_was_measured(replay: Callable[..., Any], tmp_path: Path) -> None:
    """25 s on deck, 20 s at the surface, and then a dive: without that, the vehicle flies 8 m into the air."""
    time, rov = 0.1 * np.arange(300), load("bluerov2")
    pushes = np.repeat([0.5, 0.2, 0.4], 100)
    dive = rov.simulate(time, {"heave": pushes}, start={"z": 0.15})["z"]
    depth = np.concatenate([np.full(250, -0.37), np.linspace(-0.37, 0.15, 20), np.full(180, 0.15), dive])
    signs = rov.layout.signs(AXES["heave"])
    columns = [np.concatenate([np.zeros(450), 100.0 * sign * pushes]) for sign in signs.values()]
    titles = ["time [s]", *(f"{name} [%]" for name in signs), "depth [m]"]
    rows = zip(0.1 * np.arange(750), *columns, depth, strict=True)
    log = tmp_path / "harbour.csv"
    log.write_text("\n".join([",".join(titles), *(",".join(map(str, row)) for row in rows)]), encoding="utf-8")
    page = replay(log, vehicle="bluerov2")
    errors = np.abs(page.evaluate("live.flight.replay.errors[0]"))
    assert len(errors) == 750
    assert errors[440] < 0.01, "44 s after the start it rests at the surface"
    assert np.delete(errors, slice(250, 270)).max() < 0.3, "but for the two seconds in which it is lowered"


@pytest.mark.interop
def test_a_recording_waits_where_motion_is_to_be_reduced(
    csv: Path, tmp_path: Path, visit: Callable[..., Visit]
) -> None:
    assert main(["fly", "videoray", "--recording", str(csv), "-o", str(tmp_path / "page.html")]) == 0
    motions: list[tuple[Any, bool]] = [("reduce", True), ("no-preference", False)]
    for motion, is_paused in motions:
        page = visit().page
        page.emulate_media(reduced_motion=motion)
        page.goto((tmp_path / "page.html").as_uri())
        page.wait_for_selector("#live-section:not([hidden])")
        assert page.evaluate("live.flight.replay !== null && live.paused") is is_paused
        expected = "auto" if is_paused else "smooth"
        assert page.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == expected


@pytest.mark.interop
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("suffix", spread([".tlog", ".ulg", ".mcap"], [".tlog"]))
def test_a_log_of_each_format_is_flown_to_its_end(suffix: str, tmp_path: Path, replay: Callable[..., Any]) -> None:
    log = LOGS[suffix](tmp_path, DIVE)
    page = replay(log, vehicle="bluerov2")
    recording = recording_of(log, load_vehicle(SHIPPED["bluerov2"]))
    end = max(recording["times"][-1], *(signal["times"][-1] for signal in recording["signals"]))
    assert page.evaluate("live.flight.times[live.flight.times.length - 1]") == pytest.approx(end)
    counts = page.evaluate("live.flight.replay.errors.map((list) => list.length)")
    assert counts == [len(signal["times"]) for signal in recording["signals"]]
    assert any(signal["quantity"] == "depth" for signal in recording["signals"])
    page.evaluate("live.pause(false); live.speed = 50")
    until(page, "live.paused")
    assert "is off by (root mean square)" in page.inner_text("#live-message")


def test_a_recording_has_commands_and_measurements(
    csv: Path, vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 200 samples of a quantity, every second is flown where more than 100 are too many."""
    monkeypatch.setattr("rov_fmu.report.page.recording._MOST_SAMPLES", 100)
    found = recording_of(csv, vehicle)
    columns = np.loadtxt(csv, delimiter=",", skiprows=1).T
    _, depth, heading = found["signals"]
    assert [(one["axis"], one["quantity"], one["isPosition"]) for one in found["signals"]] == [
        *((0, "surge velocity", False), (1, "depth", True), (2, "heading", True))
    ]
    assert depth["times"] == pytest.approx(0.2 * np.arange(100))
    assert depth["values"] == pytest.approx(columns[5][::2], abs=1e-8)
    assert np.sin(heading["values"]) == pytest.approx(np.sin(np.radians(columns[6][::2])), abs=1e-8)
    held = np.searchsorted(found["times"], 10.0, side="right") - 1
    assert found["commands"]["u_t"][held] == pytest.approx(0.01 * columns[3][100])
    (tmp_path / "log_heave.csv").write_text("time [s],command [%],z [m]\n0,30,0\n1,-50,1\n2,-50,2\n", encoding="utf-8")
    commands = recording_of(tmp_path / "log_heave.csv", vehicle)["commands"]
    assert [commands[name][:2] for name in ("u_l", "u_r", "u_t")] == [[0.0, 0.0], [0.0, 0.0], [0.3, -0.5]]
    head = "time [s],u_t [%],depth [m],heave velocity [m/s],surge velocity [m/s]"
    for depths, quantity in ((1, "heave velocity"), (5, "depth")):  # one depth is no motion
        rows = [f"{5 + n},{10 * n},{n if n < depths else ''},{0.1 * n},0.5" for n in range(5)]
        (tmp_path / "late.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
        late = recording_of(tmp_path / "late.csv", vehicle)
        assert (late["times"], late["commands"]["u_t"]) == ([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.1, 0.2, 0.3, 0.4])
        signals = [(one["quantity"], one["times"]) for one in late["signals"]]
        assert signals == [("surge velocity", late["times"]), (quantity, late["times"])]
    with_mix = flown_vehicle("everything")
    titles = [f"thruster {t.name} [%]" for t in with_mix.layout.thrusters]
    given = [100.0 * with_mix.layout.gains[t.name].get("u_sway", 0.0) * 0.4 for t in with_mix.layout.thrusters]
    rows = [",".join(map(str, (n, *given, n))) for n in range(5)]
    (tmp_path / "mixed.csv").write_text("\n".join([",".join(["time [s]", *titles, "depth [m]"]), *rows]), "utf-8")
    mixed = {name: values[0] for name, values in recording_of(tmp_path / "mixed.csv", with_mix)["commands"].items()}
    assert mixed == pytest.approx(dict.fromkeys(with_mix.layout.commands, 0.0) | {"u_sway": 0.4}, abs=1e-9)
