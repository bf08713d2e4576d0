"""The page that flies its model, in headless Chromium: its results, its messages, its requests, and its files."""

import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil, exp, log, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu import load
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, Axis
from rov_fmu.fmu.variables import variables
from rov_fmu.io.columns import PULSES
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.report.plots.steps import held_commands
from rov_fmu.tank.columns import ColumnNames, columns_of_log
from rov_fmu.tank.log import Log
from rov_fmu.tank.read_log import read_logs
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface
from tests.often import spread
from tests.report.conftest import Visit, chart, flown_vehicle, get, until
from verification.references.fmpy_slave import Slave

pytestmark = pytest.mark.interop

Fly = Callable[..., Any]
BOX = "element => element.getBoundingClientRect().toJSON()"


def said(page: Any) -> str:
    """Return the message of the page."""
    return str(page.inner_text("#live-message"))


# ---- What it computes ------------------------------------------------------------------------------------------------

_FLY = """legs => {
    live.pause(true);
    Object.assign(live.flight, { held: "", isBounded: false });
    live.flight.reset();
    const { model } = live.flight.pilot;
    return legs.map(({ length, inputs, tuning }) => {
        live.flight.tune(tuning);
        live.flight.set(inputs);
        return [live.flight.advance(length), [...model.values]];
    });
}"""


def a_manoeuvre(vehicle: Vehicle, longest: float) -> list[dict[str, Any]]:
    """Return random inputs (some commands saturate) and tunings, for 5 ms to 5 s each."""
    rng, layout = random.Random(vehicle.identifier), vehicle.layout
    return [
        {
            "length": min(longest, exp(rng.uniform(log(5e-3), log(5.0)))),
            "inputs": {name: rng.uniform(-1.2, 1.2) for name in layout.inputs},
            "tuning": {name: rng.uniform(0.4, 1.6) for name in rng.sample([*layout.tuning], 2)} if n % 5 == 4 else {},
        }
        for n in range(60)
    ]


def natively(folder: Path, vehicle: Vehicle, legs: list[dict[str, Any]]) -> Iterator[list[float]]:
    """Yield all variables after each leg, computed by the FMU's binary."""
    slave = Slave(folder)
    try:
        slave.initialize({})
        time = 0.0
        for leg in legs:
            for given in (leg["tuning"], leg["inputs"]):
                slave.put(given)
            slave.step(time, leg["length"])
            time += leg["length"]
            yield slave.get(*(v.name for v in variables(vehicle)))
    finally:
        slave.end()


def check_manoeuvre(page: Any, vehicle: Vehicle, folder: Path, longest: float = 5.0) -> None:
    """Check that all variables equal those of the FMU in this folder after each leg."""
    legs = a_manoeuvre(vehicle, longest)
    for (done, values), expected in zip(page.evaluate(_FLY, legs), natively(folder, vehicle, legs), strict=True):
        assert done
        assert values == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "longest"),
    [
        ("everything", 5.0),
        ("six", 0.05),
        *(
            pytest.param(*one, marks=pytest.mark.weekly)
            for one in (("videoray", 5.0), ("heavy", 5.0), ("rotors", 0.05))
        ),
    ],
)
def test_a_manoeuvre_is_that_of_the_native_fmu(
    kind: str, longest: float, fly: Fly, request: pytest.FixtureRequest
) -> None:
    """With six axes, a step has at most the length of those on the page."""
    check_manoeuvre(fly(kind), flown_vehicle(kind), request.getfixturevalue(f"{kind}_dir"), longest)


def test_a_manoeuvre_is_that_of_the_native_fmu_in_firefox(
    address: Callable[[str], str], firefox: Any, heavy: Vehicle, heavy_dir: Path
) -> None:
    seen = Visit(firefox)
    seen.page.goto(address("heavy"))
    seen.page.wait_for_selector("#live-section:not([hidden])")
    check_manoeuvre(seen.page, heavy, heavy_dir)
    assert seen.messages == []
    assert set(seen.requests) <= {address("heavy")}  # Firefox need not report the page itself, which is a file


# ---- What a person does with it --------------------------------------------------------------------------------------


STILL = "live.vehicle.commands.every(name => live.flight.pilot.model.get(name) === 0)"


def test_it_is_flown_by_keys_alone(fly: Fly) -> None:
    page = fly("heavy")
    assert page.evaluate("document.activeElement.id") == "live-stage"
    for key, state in (("KeyW", "x"), ("KeyD", "psi")):
        page.keyboard.down(key)
        until(page, f"live.flight.pilot.model.get('{state}') > 0.1")
        page.keyboard.up(key)
    until(page, STILL)
    page.keyboard.press("Space")
    time = page.evaluate("live.flight.time")
    page.wait_for_timeout(200)
    assert page.evaluate("live.flight.time") == time, "it pauses"
    reached: list[str] = []
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.id || document.activeElement.name || ''"))
    buttons = {f"live-{name}" for name in ["pause", "slower", "faster", "reset", "still", "test", "run", "recording"]}
    assert buttons | {"u_1", "u_8"} <= set(reached)
    page.focus("input[name=u_5]")
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    until(page, "live.flight.pilot.model.get('u_5') > 0")


def test_a_gamepad_steers_and_lets_go(fly: Fly, heavy: Vehicle) -> None:
    page = fly("heavy")
    sticks = {"yaw": 0.5, "heave": -0.25, "sway": 0.05, "surge": 0.75}  # sway is within the dead zone
    axes = [sticks["yaw"], sticks["heave"], sticks["sway"], -sticks["surge"]]
    page.evaluate("axes => { navigator.getGamepads = () => [null, { mapping: 'standard', axes }]; }", axes)
    until(page, "live.flight.pilot.model.get('r') > 0.1")
    expected = dict.fromkeys(heavy.layout.commands, 0.0)
    # A turn of 0.5 would saturate one side. The force of both sides is that of 0.75 ahead, because thrust is quadratic.
    shares = sticks | {"sway": 0.0, "yaw": 0.25, "surge": sqrt(0.75**2 - 0.25**2)}
    for form in heavy.layout.axes:
        for name, sign in heavy.layout.signs(form.axis).items():
            expected[name] += sign * shares[form.axis.name]
    assert get(page, *expected) == pytest.approx([*expected.values()])
    page.evaluate("() => { navigator.getGamepads = () => []; }")
    until(page, STILL)


def test_a_finger_on_a_stick_steers_until_it_is_lifted(browser: Any, address: Callable[[str], str]) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto(address("videoray"))
    page.wait_for_selector("#live-section:not([hidden])")
    box = page.locator("#live-right").evaluate(BOX)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    finger = context.new_cdp_session(page)
    touch = "Input.dispatchTouchEvent"
    finger.send(touch, {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    finger.send(touch, {"type": "touchMove", "touchPoints": [{"x": x, "y": y - 60}]})
    until(page, "live.flight.pilot.model.get('u_l') === 0.7 && live.flight.pilot.model.get('x') > 0.01")
    assert page.evaluate("scrollY") == 0
    finger.send(touch, {"type": "touchEnd", "touchPoints": []})
    until(page, "live.flight.pilot.model.get('u_l') === 0")
    context.close()


def test_a_step_test_stops_at_its_end(page: Any, vehicle: Vehicle) -> None:
    page.evaluate("live.speed = 10")
    for command in held_commands(vehicle):
        page.select_option("#live-test", label=f"heave {command} %")
        page.click("#live-run")
        V, Tau = vehicle.response(HEAVE, float(command) / 100.0)
        until(page, "live.paused")
        assert page.evaluate("[live.flight.time, live.flight.times[0]]") == pytest.approx([ceil(6.0 * Tau), 0.0])
        assert chart(page, "heave")["words"] == f"V_ss {V:.3f} · Tau {Tau:.2f} s"
        assert "The test has ended." in said(page)
    assert page.evaluate("live.flight.time / live.span") == pytest.approx(1.0), "the curve fills the chart"
    page.locator("input[name=u_l]").fill("0.25")
    until(page, f"live.flight.time > {ceil(6.0 * Tau)}")


def test_another_vehicle_flies_the_same_commands_as_a_ghost(tmp_path: Path, fly: Fly) -> None:
    other = without_surface(load_vehicle(SHIPPED["bluerov2"]))
    assert main(["fly", "videoray", "--against", "bluerov2", "-o", str(tmp_path / "both.html")]) == 0
    page = fly((tmp_path / "both.html").as_uri())
    ghost = page.evaluate(
        """names => {
            live.pause(true);
            live.flight.isBounded = false;
            live.flight.set({ u_l: 0.5, u_r: 0.3, u_t: -0.2 });
            live.flight.advance(3);
            return names.map((name) => live.flight.ghost.model.get(name));
        }""",
        [*other.layout.state],
    )
    demands = {"surge": 0.4, "yaw": 0.1, "heave": -0.2}
    inputs = dict.fromkeys(other.layout.inputs, 0.0)
    for form in other.layout.axes:
        for name, sign in other.layout.signs(form.axis).items():
            inputs[name] += sign * demands.get(form.axis.name, 0.0)
    expected = other.step(inputs, dict.fromkeys(other.layout.state, 0.0), 3.0)
    assert dict(zip(other.layout.state, ghost, strict=True)) == pytest.approx(expected, rel=1e-11, abs=1e-12)
    assert page.is_checked("#live-ghost")


def test_an_exported_flight_can_be_flown_again_and_inspected(page: Any, tmp_path: Path) -> None:
    """Frames of any length are flown again as they were, although their times are rounded to microseconds."""
    page.evaluate(
        """() => {
            live.speed = 5;
            const { frame } = live;
            live.frame = now => frame.call(live, now + Math.random());
        }"""
    )
    page.locator("input[name=u_l]").fill("0.5")
    until(page, "live.flight.times.length > 20")
    page.locator("input[name=u_t]").fill("0.3")
    until(page, "live.flight.times.length > 40")
    page.evaluate("live.pause(true)")
    with page.expect_download() as download:
        page.click("#live-export")
    assert download.value.suggested_filename == "videoray.csv"
    file = tmp_path / "videoray.csv"
    download.value.save_as(file)
    times = [line.split(",")[0] for line in file.read_text(encoding="utf-8").splitlines()[1:]]
    assert len(times) > 40
    assert all(re.fullmatch(r"\d+(\.\d{1,6})?", time) for time in times), times
    drop(page, file)
    page.evaluate("live.pause(false); live.speed = 50")
    until(page, "live.paused && live.flight.replay && live.hasEnded()")
    assert max(deviations(page)) < 1e-12
    assert main(["inspect", str(file)]) == 0


def test_a_link_contains_vehicle_commands_and_tuning(page: Any, address: Callable[[str], str], fly: Fly) -> None:
    page.locator("summary", has_text="Tuning").click()
    page.locator("input[name=u_t]").fill("-0.4")
    page.locator("input[name=alpha_w]").fill("1.5")
    page.evaluate("() => { navigator.clipboard.writeText = async () => { throw new Error('not allowed'); }; }")
    page.click("#live-share")
    assert page.url == f"{address('videoray')}#vehicle=videoray&u_t=-0.4&alpha_w=1.5"
    assert "address of this page" in said(page)
    there = fly(page.url)
    until(there, "live.flight.time > 0.2")
    assert get(there, "u_t", "alpha_w", "u_l") == [-0.4, 1.5, 0.0]


_NOT_USED = "The link has values that this page cannot use: "


@pytest.mark.parametrize(
    ("link", "message"),
    [
        ("heavy&u_1=1", "The link is for the vehicle “heavy”, and this page flies “videoray”."),
        ("videoray&u_l=0.25&u_t=7", f"{_NOT_USED}u_t=7 (must be a number from -1 to 1)."),
        ("videoray&u_l=0.25&u_t=", f"{_NOT_USED}u_t= (must be a number from -1 to 1)."),
        ("videoray&u_l=0.25&alpha_u=-3", f"{_NOT_USED}alpha_u=-3 (must be a number from 0.1 to 3.0)."),
        ("videoray&u_l=0.25" + "&x=1" + "&y=1" * 5, " not a value of this vehicle"),
    ],
)
def test_a_link_that_is_not_allowed_says_so_and_leaves_out_what_is_wrong(page: Any, link: str, message: str) -> None:
    (alpha,) = get(page, "alpha_u")
    page.evaluate("hash => { location.hash = hash; }", f"vehicle={link}")
    until(page, "document.getElementById('live-message').textContent.startsWith('The link')")
    assert message in said(page).replace("(not", " not")
    assert get(page, "u_l", "u_t", "alpha_u") == [0.25 if "u_l" in link else 0.0, 0.0, alpha]


# ---- Recordings ------------------------------------------------------------------------------------------------------


def drop(page: Any, file: Path) -> None:
    """Give a file to the page, as its button does."""
    page.set_input_files("#live-recording", file)


def dropped(page: Any, log: Path, text: str, encoding: str = "utf-8") -> Any:
    """Write a log, give it to the page, and return the recording that the page reads."""
    log.write_text(text, encoding=encoding)
    page.evaluate("live.flight.replay = null")
    drop(page, log)
    until(page, "live.flight.replay !== null")
    return page.evaluate("live.flight.replay.recording")


def deviations(page: Any) -> list[float]:
    """Return how far the prediction is off along each axis, by the message of the page."""
    found = [float(number) for number in re.findall(r"(?:surge|heave|yaw) (\S+) ", said(page))]
    assert len(found) == 3
    return found


COMMANDS = {f"u_{name} [%]": 80.0 for name in "lrt"}


def a_recording(inputs: Mapping[str, float] = COMMANDS) -> str:
    """A log of the VideoRay's model at 10 Hz over 20 s, with random inputs up to these values, for 2.5 s each."""
    time, rng = 0.1 * np.arange(200), np.random.default_rng(3)
    columns = {title: most * rng.uniform(-1.0, 1.0, 8).repeat(25) for title, most in inputs.items()}
    given = {title.split()[0]: values / (100.0 if "%" in title else 1.0) for title, values in columns.items()}
    run = load("videoray").simulate(time, given, start={"z": 9.0})
    heading = (np.degrees(run["psi"]) + 180.0) % 360.0 - 180.0
    rows = zip(time, *columns.values(), run["u"], run["z"], heading, strict=True)
    titles = ["time [s]", *columns, "surge velocity [m/s]", "depth [m]", "heading [deg]"]
    return "\n".join([",".join(titles), *(",".join(f"{value:.17g}" for value in row) for row in rows)])


def test_a_recording_is_taken_where_it_is_dropped_and_flies_beside_its_prediction(page: Any) -> None:
    page.evaluate("document.getElementById('live-picture').dispatchEvent(new DragEvent('dragover', { bubbles: true }))")
    outline = "() => getComputedStyle(document.querySelector('.deck')).outlineStyle"
    assert page.evaluate(outline) == "dashed", "the page shows that it takes the file"
    page.evaluate(
        """text => {
            const dataTransfer = new DataTransfer();
            dataTransfer.items.add(new File([text], "pool.csv"));
            document.getElementById("live-picture").dispatchEvent(
                new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
        }""",
        a_recording(),
    )
    until(page, "live.flight.replay !== null")
    assert page.evaluate(outline) == "none"
    page.evaluate("live.speed = 20")
    until(page, "live.paused")
    first = page.evaluate("live.flight.replay.errors.map((list) => Math.max(...list.slice(0, 100).map(Math.abs)))")
    assert max(first) < 1e-8, "the recording is that of the model"
    assert max(deviations(page)) < 10.0, "the velocity at its second begin is that of the measured way, m, m/s, degrees"
    assert page.is_checked("#live-ghost")
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.pilot.model.get('u_t') === 0.5")
    assert page.evaluate("live.flight.replay") is None, "the pilot has control again"
    page.click("#live-reset")
    assert not page.is_checked("#live-ghost"), "what was measured is gone"


STAMPS = [f"2026-07-01T23:59:5{n % 10},{25 * n:03}+02{':' * (n % 2)}00" for n in range(10)]
QUOTED = [f'"{title}"' for title in ("time [ms]", "Thruster, port [V]", "u_t [%]", "heave depth [cm]", "Notes")]
WRITTEN = {
    "dates": ["time [s];u_t [%];depth [m]", *(f"{stamp};{n};{n}" for n, stamp in enumerate(STAMPS))],
    "rostopic": ["%time,u_t [%],-z [m]", *(f"{1_669_909_208_000_000_000 + 10**8 * n},{n},{-n}" for n in range(10))],
    "pressure": ["time [s],t [us 1520 320],pressure [kPa]", *(f"{n},{1520 + n},{101.325 + n}" for n in range(10))],
    "force": ["time [us],u_t [N.m 40],z [mm],voltage [V]", *(f"{10**6 * n},{n},{n},16" for n in range(10))],
    "times of day": [
        "Date;Time;u_t [%];depth [m]",
        *(f"2025-10-08;23:59:{n + 50};{n};{n}" for n in range(10)),
        *(f"2025-10-09;00:00:0{n};{n};{n}" for n in range(10)),
    ],
    "decimal commas in quotes": ["time [s],u_t [%],depth [m]", *(f'"{n},5","{n},500","0,{n}"' for n in range(10))],
    "a clock set back": [
        ";".join(QUOTED),
        *(f"{100 * (n % 30)};12,5;{n},5;{5 * n // 2},{5 * n % 2 * 5};-" for n in range(42)),
    ],
}


PRESSED = "time [s],u_t [%],pressure [kPa],surge velocity [m/s]"
WRITTEN |= {
    "a barometer in the water": [PRESSED, *(f"{n},{n},{101.3 + 0.1 * n},{0.01 * n}" for n in range(40))],
    "a barometer in the hull": [PRESSED, *(f"{n},{n},{101.3 + 0.001 * n},{0.01 * n}" for n in range(40))],
    "a wrong unit": [PRESSED.replace("k", ""), *(f"{n},{n},{101.3 + 0.1 * n},{0.01 * n}" for n in range(40))],
    "a frozen depth": ["time [s],u_t [%],depth [m],pressure [kPa]", *(f"{n},{n},1,{101 + n}" for n in range(40))],
}
ONE_BY_ONE = "time [s],u_l [%],u_t [%],depth [m],heading [deg]"
MESSAGES = ("{},,,", ",{},,", ",,{},", ",,,{}")
WRITTEN |= {
    "a row for each message": [ONE_BY_ONE, *(f"{n},{MESSAGES[n % 4].format(n)}" for n in range(80))],
    "tables one after the other": [ONE_BY_ONE, *(f"{n},{one.format(n)}" for one in MESSAGES for n in range(40))],
    "a command that begins late": [ONE_BY_ONE, *(f"{n},{n if n > 5 else ''},{n},{n},{n}" for n in range(40))],
}


_PLAIN = ["time [s];u_t [%];roll [°];heave depth [cm]", *(f"{n};{n},5;0,5;{n}" for n in range(40))]
WRITTEN |= {
    "code page 1252": _PLAIN,
    "UTF-16": _PLAIN,
    "a separator for Excel": ["sep=;", *_PLAIN],
    "an instrument": ["Tank; of Odense, Denmark; by us; all", "Rate [Hz];10;;", "Date;2024-05-11;;", "", *_PLAIN],
    "comments": ["# by hand", "# 1;2;3;4", f"# {_PLAIN[0]}", *_PLAIN[1:]],
}
ENCODINGS = {"code page 1252": "cp1252", "UTF-16": "utf-16"}


def check_read_alike(recording: Any, log: Log, axes: Sequence[Axis]) -> None:
    """Check that the page has the measurements of these axes that identify uses."""
    used = {(c.quantity.axis, not c.quantity.is_velocity): c for c in log.channels if not c.unused}
    assert {axes[signal["axis"]] for signal in recording["signals"]} == {axis for axis, _ in used if axis in axes}
    for signal in recording["signals"]:
        channel = used[axes[signal["axis"]], signal["isPosition"]]
        times, values = channel.unwrapped
        there = values[log.commands is None or times >= log.commands.rows[0]]
        assert np.sin(signal["values"]) == pytest.approx(np.sin(there), abs=1e-6), log.file


@pytest.mark.parametrize("name", WRITTEN)
def test_a_log_is_read_as_identify_reads_it(name: str, page: Any, vehicle: Vehicle, tmp_path: Path) -> None:
    """After the clock was set back, the rows are another recording."""
    recording = dropped(page, tmp_path / "pool.csv", "\n".join(WRITTEN[name]), ENCODINGS.get(name, "utf-8"))
    read, *_ = read_logs(tmp_path / "pool.csv", vehicle.layout, ColumnNames())
    check_read_alike(recording, read, [form.axis for form in vehicle.layout.axes])
    assert read.commands is not None
    rows = np.unique(np.concatenate([read.commands.rows, *(channel.time for channel in read.channels)]))
    rows = rows[rows >= read.commands.rows[0]]
    assert [*dict.fromkeys(recording["times"])] == pytest.approx(rows - rows[0], abs=1e-6)
    held = dict(
        zip(recording["times"], zip(*(recording["commands"][f"u_{one}"] for one in "lt"), strict=True), strict=True)
    )
    commands = read.commands.at(rows)[:, [read.commands.thrusters.index(one) for one in "lt"]]
    assert np.array([*held.values()]) == pytest.approx(commands)
    assert commands.any()
    left = {"a clock set back": 12, "a row for each message": 1}
    assert recording["left"] == left.get(name, 0)
    assert ("The pressure is not used" in said(page)) is (name in ("a barometer in the hull", "a wrong unit"))


@pytest.mark.parametrize("kind", spread(["videoray", "everything"], ["everything"]))
@pytest.mark.parametrize("axis", [None, HEAVE], ids=["dive", "log of heave"])
def test_every_column_that_identify_reads_is_read(kind: str, axis: Axis | None, fly: Fly, tmp_path: Path) -> None:
    """Each name of each column of the catalogue, in each of its units, beside a column of another kind."""
    layout = flown_vehicle(kind).layout
    known = columns_of_log(layout, axis)
    command = next(name for name, one in known.items() if one.commands)
    logs = []
    for name, column in known.items():
        beside = f"{command} [%]" if not column.commands else "depth [m]"
        units = [
            *column.units,
            *(f"{unit} 2000" for unit in column.conversions if unit not in PULSES),
            "us",
            "us 0 2000",
        ]
        for title in (name, *column.also):
            for unit in units:
                header = f"time [s],{beside},{title.upper()} [{unit}]" + ("" if column.commands else ",voltage [V]")
                rows = [f"{n},{n},{1000 + n}{'' if column.commands else ',12'}" for n in range(30)]
                logs.append("\n".join([header, *rows]))
    path = tmp_path / ("log_heave.csv" if axis else "dive.csv")
    flown = fly(kind).evaluate(
        """([texts, name]) => texts.map((text) => {
            try { return readRecording(text, name, live.vehicle); } catch (error) { return error.message; }
        })""",
        [logs, path.name],
    )
    axes = [form.axis for form in layout.axes]
    read_by_both = 0
    for text, recording in zip(logs, flown, strict=True):
        path.write_text(text, encoding="utf-8")
        try:
            (log,) = read_logs(path, layout, ColumnNames(), axis)
        except DataFileError:
            continue
        if log.commands and any(c.quantity.axis in axes and not c.unused for c in log.channels):
            assert isinstance(recording, dict), f"{text[:80]}: {recording}"
            check_read_alike(recording, log, axes)
            read_by_both += 1
    assert read_by_both > 20


BAD = {
    "times of 12 hours": (
        b"Time,u_t [%],depth [m]\n12:59:58 PM,1,1\n12:59:59 PM,2,1\n01:00:00 PM,3,1\n",
        "its times are in another form; write seconds, a time of day such as 10:08:02.5, or 2026-05-01T10:08:02.5",
    ),
    "empty": (b"", "less than two rows"),
    "other columns": (b"a,b\n1,2\n3,4\n", "no column \N{LEFT DOUBLE QUOTATION MARK}time"),
    "no command": (
        b"time [s],depth [m]\n0,1\n1,2\n",
        "no column of a command, such as \N{LEFT DOUBLE QUOTATION MARK}u_l [%]",
    ),
    "no motion": (
        b"time [s],u_l [%],Depth (m)\n0,1,0\n1,2,0\n",
        "such as \N{LEFT DOUBLE QUOTATION MARK}surge velocity [m/s]\N{RIGHT DOUBLE QUOTATION MARK}; if another header",
    ),
    "unit": (b"time [s],u_l [kg],depth [m]\n0,1,0\n1,2,0\n", "u_l [kg]\N{RIGHT DOUBLE QUOTATION MARK} has no unit"),
    "huge": (b"time [s],u_l [%],depth [m]\n" + b"0,1,0\n" * 4_000_000, "larger than 20 MB"),
    "fractions": (
        b"time [s],u_l [%],depth [m]\n0,0.2,0\n1,0.5,0\n",
        "no command exceeds 1 %. Are they fractions? Then write [1]",
    ),
    "two logs": (b"time [s],u_l [%],depth [m]\n" + b"0,9,0\n1,9,0\n2,9,0\n" * 2, "its time goes back, and stays back"),
    "hull": (b"time [s],u_t [%],pressure [Pa]\n0,9,101000\n1,9,101002\n", "the barometer seems to be inside the hull"),
    "twice": (b"time [s],u_l [%],depth [m],z [m]\n0,9,0,0\n1,9,1,1\n", "two of its columns tell the same of heave"),
    "long": (b"time [s],u_l [%],depth [m]\n0,9,0\n1e9,9,0\n", "longer than a day"),
}


def test_the_page_says_why_a_file_is_no_recording_and_the_model_flies_on(page: Any, tmp_path: Path) -> None:
    page.locator("input[name=u_l]").fill("0.5")
    for name, (content, expected) in BAD.items():
        page.evaluate("live.say('')")
        file = tmp_path / f"{name}.csv"
        file.write_bytes(content)
        drop(page, file)
        until(page, "document.getElementById('live-message').textContent !== ''")
        line = page.inner_text("#live-message")
        assert line.startswith(f"{name}.csv cannot be flown: "), line
        assert expected in line, line
        time = page.evaluate("live.flight.time")
        until(page, f"live.flight.time > {time}")
        assert page.evaluate("live.flight.pilot.model.get('u_l')") == 0.5


# ---- Elsewhere -------------------------------------------------------------------------------------------------------


def test_the_page_says_that_a_browser_cannot_fly_it(address: Callable[[str], str], visit: Callable[..., Visit]) -> None:
    page = visit().page
    page.add_init_script("delete globalThis.WebAssembly")
    page.goto(address("videoray"))
    page.wait_for_selector("#live-sorry:not([hidden])")
    assert not page.locator("#live-section").is_visible()
