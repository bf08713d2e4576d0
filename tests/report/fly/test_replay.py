"""`rov-fmu fly --recording`: logs of every format beside the model, on a timeline, with bands and unknown forces."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rov_fmu import load
from rov_fmu.cli import main
from rov_fmu.report.page.recording import recording_of, topic_name
from rov_fmu.tank.columns import Names
from rov_fmu.tank.read_log import read_logs
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.report.conftest import Visit
from tests.report.test_live import a_recording, flying, until

_PLACES = [folder / "shared" / "cases" / "logs" for folder in Path(__file__).parents]
LOGS = next((place for place in _PLACES if place.is_dir()), None)
"""Logs of many formats, which are beside the repository where its developers have them."""
FORMATS = {
    "tlog": "17-pulse-range-of-the-autopilot/log_dive.tlog",
    "bin": "16-ekf-primary-core/log_dive.bin",
    "ulg": "21-px4-outputs-of-another-module/dive.ulg",
    "mcap": "03-depth-reference-topic/dive.mcap",
}


@pytest.fixture
def csv(tmp_path: Path, vehicle: Vehicle) -> Path:
    """The log of a flight of the model itself, with a header that only rov.toml explains."""
    path = tmp_path / "dive.csv"
    path.write_text(a_recording(vehicle).replace("depth [m]", "tiefe"), encoding="utf-8")
    (tmp_path / "rov.toml").write_text('[columns]\n"tiefe" = "depth [m]"\n', encoding="utf-8")
    return path


def page_of(csv: Path, target: Path, *options: str) -> str:
    assert main(["fly", "videoray", "--recording", str(csv), *options, "-o", str(target)]) == 0
    return target.as_uri()


def test_a_recording_has_the_commands_and_the_measurements_of_its_log(csv: Path, vehicle: Vehicle) -> None:
    recording = recording_of(csv, vehicle)
    names = Names({"tiefe": "depth [m]"})
    (log,) = read_logs(csv, vehicle.layout, names)
    assert log.commands is not None
    for name, values in recording["commands"].items():
        thruster = log.commands.thrusters.index(name.removeprefix("u_"))
        expected = log.commands.at(np.array(recording["times"]) + log.commands.rows[0])[:, thruster]
        assert values == pytest.approx(expected, abs=1e-9)
    quantities = [signal["quantity"] for signal in recording["signals"]]
    assert quantities == ["surge velocity", "depth", "heading"]
    for signal in recording["signals"]:
        channel = log.used(signal["quantity"])
        assert channel is not None
        assert np.sin(signal["values"]) == pytest.approx(np.sin(channel.values), abs=1e-8)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("time [s],depth [m]\n0,1\n1,2\n", "there is no column of commands"),
        ("time [s],u_l [%]\n0,1\n1,2\n", "is missing"),
        ("time [s],u_l [%],depth [m]\n0,9,\n1,9,\n2,9,\n", "no motion of an axis of this vehicle was found"),
    ],
)
def test_a_log_that_cannot_be_flown_is_refused_in_one_line(
    text: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "dive.csv"
    log.write_text(text, encoding="utf-8")
    assert main(["fly", "videoray", "--recording", str(log), "-o", str(tmp_path / "page.html")]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "dive.csv" in error
    assert reason in error
    assert not (tmp_path / "page.html").exists()


def test_what_was_identified_needs_its_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", "--identified", "logs.mcap", "-o", str(tmp_path / "page.html")]) == 2
    assert "--recording" in capsys.readouterr().err


@pytest.mark.interop
def test_the_timeline_goes_to_any_time_and_the_charts_show_the_error(
    csv: Path, tmp_path: Path, visit: Callable[..., Visit], vehicle: Vehicle
) -> None:
    page = flying(visit, page_of(csv, tmp_path / "page.html")).page
    assert page.locator("#live-timeline").is_visible()
    assert page.input_value("#live-view") == "measured"
    page.evaluate("live.pause(true)")
    errors = page.evaluate("live.flight.replay.errors.map((list) => Math.max(...list.map(Math.abs)))")
    assert len(errors) == 3
    assert max(errors) < 1e-8, "the recording is that of the model"
    recording = recording_of(csv, vehicle)
    depths = dict(zip(recording["signals"][1]["times"], recording["signals"][1]["values"], strict=True))
    for time in (15.0, 3.0, 19.9, 0.0):
        page.evaluate(
            "(t) => { const one = document.getElementById('live-timeline'); one.value = t;"
            " one.dispatchEvent(new Event('input')); live.draw(); }",
            time,
        )
        shown = page.evaluate("[live.flight.pilot, live.flight.ghost].map(({ model }) => model.get('z'))")
        assert shown == pytest.approx([depths[time]] * 2, abs=1e-6)
        assert "error 0.00" in (page.text_content("#live-chart-heave .marks") or "").replace("\N{MINUS SIGN}", "")
    page.select_option("#live-view", "error")
    until(page, "!live.changed")
    assert page.locator("#live-charts svg").count() == 3
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.replay === null")
    assert not page.locator("#live-timeline").is_visible(), "the pilot has control"


@pytest.mark.interop
def test_tuning_flies_the_recording_again_where_it_is_shown(
    csv: Path, tmp_path: Path, visit: Callable[..., Visit]
) -> None:
    page = flying(visit, page_of(csv, tmp_path / "page.html")).page
    page.evaluate("() => { live.pause(true); live.flight.seek(12); }")
    page.locator("summary", has_text="Tuning").click()
    page.locator("input[name=beta_w]").fill("0.3")
    assert page.evaluate("live.flight.time") == 12.0
    assert page.evaluate("Math.max(...live.flight.replay.errors[1].map(Math.abs))") > 0.01


@pytest.mark.interop
def test_forces_on_the_body_are_flown_as_loads(tmp_path: Path, visit: Callable[..., Visit]) -> None:
    """The log is of the model itself, whose loads hold for 2 s each."""
    time, random = np.arange(0.0, 20.0, 0.1), np.random.default_rng(3)
    names = {"X_ext [N]": 8.0, "Z_ext [N]": 4.0, "N_ext [N.m]": 0.2}
    forces = {name: most * random.uniform(-1.0, 1.0, 10).repeat(20) for name, most in names.items()}
    run = load("videoray").simulate(time, {name.split()[0]: values for name, values in forces.items()})
    columns = [time, *forces.values(), run["u"], run["z"], run["psi"]]
    header = ",".join(["time [s]", *names, "surge velocity [m/s]", "depth [m]", "heading [rad]"])
    np.savetxt(tmp_path / "dive.csv", np.column_stack(columns), "%.17g", ",", header=header, comments="")
    (tmp_path / "rov.toml").write_text("[logs]\nwrench = true\n", encoding="utf-8")
    page = flying(visit, page_of(tmp_path / "dive.csv", tmp_path / "page.html")).page
    errors = page.evaluate("live.flight.replay.errors.map((list) => Math.max(...list.map(Math.abs)))")
    assert len(errors) == 3
    assert max(errors) < 1e-7, "numbers of a recording have nine decimals"
    page.evaluate("() => { live.pause(true); live.flight.seek(11); live.takeOver(); }")
    assert page.evaluate("['X_ext', 'Z_ext', 'N_ext'].map((name) => live.flight.pilot.model.get(name))") == [0, 0, 0]


@pytest.mark.interop
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("kind", FORMATS)
def test_a_log_of_each_format_is_flown(kind: str, tmp_path: Path, visit: Callable[..., Visit]) -> None:
    """The synthetic dives end where their commands and measurements say."""
    if not LOGS:
        pytest.skip("the logs of other formats are not beside the repository")
    log, target = LOGS / FORMATS[kind], tmp_path / "page.html"
    assert main(["fly", "bluerov2", "--recording", str(log), "-o", str(target)]) == 0
    seen = flying(visit, target.as_uri())
    vehicle = load_vehicle(SHIPPED["bluerov2"])
    recording = recording_of(log, vehicle)
    end = max(recording["times"][-1], *(signal["times"][-1] for signal in recording["signals"]))
    assert seen.page.evaluate("live.flight.times[live.flight.times.length - 1]") == pytest.approx(end)
    counts = seen.page.evaluate("live.flight.replay.errors.map((list) => list.length)")
    assert counts == [len(signal["times"]) for signal in recording["signals"]]
    assert any(signal["quantity"] == "depth" for signal in recording["signals"])
    seen.page.evaluate("live.speed = 50")
    until(seen.page, "live.paused")
    assert "The prediction is off by" in seen.page.inner_text("#live-message")
    assert seen.problems() == []


@pytest.mark.interop
def test_the_bands_and_the_unknown_force_of_the_identification_are_charts(
    csv: Path, tmp_path: Path, visit: Callable[..., Visit]
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
    identified = tmp_path / "logs.mcap"
    identified.write_bytes(written.content())
    address = page_of(csv, tmp_path / "page.html", "--identified", str(identified))
    page = flying(visit, address).page
    page.evaluate("() => { live.pause(true); live.flight.seek(15); live.draw(); }")
    assert (page.text_content("#live-chart-heave .marks") or "").endswith("± 1.50")
    page.select_option("#live-view", "force")
    until(page, "!live.changed")
    assert page.text_content("#live-chart-heave .title") == "heave: unknown 3.00 N"
    assert (page.get_attribute("#live-chart-heave .band", "d") or "").endswith("Z")
