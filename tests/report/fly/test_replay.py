"""`rov-fmu fly --recording`: logs of every format beside the model, on a timeline, with bands and unknown forces."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rov_fmu.cli import main
from rov_fmu.report.page.recording import recording_of, topic_name
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.report.conftest import until
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


ERRORS = "live.flight.replay.errors.map((list) => Math.max(...list.map(Math.abs)))"
"""The largest error along each axis."""


@pytest.mark.parametrize(
    ("text", "options", "reason"),
    [
        ("time [s],depth [m]\n0,1\n1,2\n", ["--recording", "dive.csv"], "there is no column of commands"),
        ("time [s],u_l [%]\n0,1\n1,2\n", ["--recording", "dive.csv"], "is missing"),
        ("time [s],u_l [%],depth [m]\n0,9,\n1,9,\n2,9,\n", ["--recording", "dive.csv"], "no motion of an axis of this"),
        ("", ["--identified", "logs.mcap"], "--recording"),
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
    errors = page.evaluate(ERRORS)
    assert len(errors) == 3
    assert max(errors) < 1e-8, "the recording is that of the model"
    _, depth, _ = recording_of(csv, vehicle)["signals"]
    depths = dict(zip(depth["times"], depth["values"], strict=True))
    for time in (15.0, 3.0, 19.9, 0.0):
        page.evaluate(
            "(t) => { const one = document.getElementById('live-timeline'); one.value = t;"
            " one.dispatchEvent(new Event('input')); live.draw(); }",
            time,
        )
        shown = page.evaluate("[live.flight.pilot, live.flight.ghost].map(({ model }) => model.get('z'))")
        assert shown == pytest.approx([depths[time]] * 2, abs=1e-6)
        assert "error 0.00" in page.text_content("#live-chart-heave .marks").replace("\N{MINUS SIGN}", "")
    page.select_option("#live-view", "error")
    until(page, "!live.changed")
    assert page.locator("#live-charts svg").count() == 3
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.replay === null")
    assert not page.locator("#live-timeline").is_visible(), "the pilot has control"


@pytest.mark.interop
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("suffix", [".tlog", ".ulg", ".mcap"])
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
    assert "The prediction is off by" in page.inner_text("#live-message")


@pytest.mark.interop
def test_the_bands_and_the_unknown_force_of_the_identification_are_charts(
    csv: Path, tmp_path: Path, replay: Callable[..., Any]
) -> None:
    mcap = pytest.importorskip("rov_fmu.bridges.mcap")
    pytest.importorskip("foxglove")
    number = mcap.Number("m", "a number")
    written = mcap.Recording({"name": "VideoRay"})
    name = topic_name(csv.name)
    depth = written.topic(f"/{name}/depth", dict.fromkeys(("measured", "predicted", "low", "high"), number))
    force = written.topic(f"/{name}/unknown_force/heave", dict.fromkeys(("force", "low", "high"), number))
    for n in range(200):
        band = {"predicted": 1.0, "low": 1.0 - 0.01 * n, "high": 1.0 + 0.01 * n} if n >= 50 else {}
        depth(n * 100_000_000, {"measured": 0.0} | band)
        force(n * 100_000_000, {"force": 0.02 * n, "low": 0.02 * n - 0.5, "high": 0.02 * n + 0.5})
    (tmp_path / "logs.mcap").write_bytes(written.content())
    page = replay(csv, "--identified", str(tmp_path / "logs.mcap"))
    page.evaluate("() => { live.flight.seek(15); live.draw(); }")
    assert page.text_content("#live-chart-heave .marks").endswith("± 1.50")
    page.select_option("#live-view", "force")
    until(page, "!live.changed")
    assert page.text_content("#live-chart-heave .title") == "heave: unknown 3.00 N"
    assert page.get_attribute("#live-chart-heave .band", "d").endswith("Z")
