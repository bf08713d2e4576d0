"""MCAP files, read back with the public reader: numbers, units, frames and pictures."""

import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import rov_fmu
from rov_fmu.bridges.mcap_logs import identification_mcap
from rov_fmu.bridges.sitl import Flight, Setup
from rov_fmu.bridges.sitl_frames import servos_of
from rov_fmu.bridges.sitl_protocol import ServoPacket
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.result import UnknownForce
from rov_fmu.interface.model import VehicleModel
from rov_fmu.interface.result import Result
from rov_fmu.io.messages import InputError
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.log import Channel, Source
from tests.folders import small_folder
from tests.report.results import example


def recorded(vehicle: VehicleModel, seconds: float, inputs: Mapping[str, Any], **start: float) -> Result:
    """Return a simulation with all inputs and outputs, every 0.1 s."""
    layout = vehicle.layout
    names = [*layout.inputs, *layout.state, *layout.calculated]
    return vehicle.simulate(np.arange(0.0, seconds + 0.05, 0.1), inputs, start=start, record=names)


def messages(content: bytes) -> dict[str, list[tuple[int, Any]]]:
    """Return the stamps (ns) and the messages of each topic."""
    found: dict[str, list[tuple[int, Any]]] = {}
    reader = make_reader(BytesIO(content), validate_crcs=True, decoder_factories=[DecoderFactory()])
    for _, channel, message in reader.iter_messages():
        if channel.message_encoding == "json":
            decoded = json.loads(message.data)
        else:
            decoded = DecoderFactory().decoder_for(channel.message_encoding, _)(message.data)  # type: ignore[misc]
        found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


@pytest.fixture(scope="module")
def heavy() -> VehicleModel:
    """The vehicle with six axes."""
    return rov_fmu.load("bluerov2_heavy")


def test_numbers_and_units(heavy: VehicleModel) -> None:
    """All variables have the values, times and units of the simulation, and inputs are written when they change."""
    result = recorded(heavy, 2.0, {"u_5": lambda t: np.where(t < 1.0, 0.2, -0.1), "V_N": 0.3})
    content = heavy.to_mcap(result)
    found = messages(content)
    assert [stamp for stamp, _ in found["/outputs"]] == [100_000_000 * n for n in range(21)]
    for n, (_, values) in enumerate(found["/outputs"]):
        assert values == {name: result[name][n] for name in values}
    assert {name for _, values in found["/outputs"] for name in values} == result.keys() - heavy.layout.inputs.keys()
    assert [(stamp, values["u_5"], values["V_N"]) for stamp, values in found["/inputs"]] == [
        (0, 0.2, 0.3),
        (1_000_000_000, -0.1, 0.3),
    ]
    summary = make_reader(BytesIO(content)).get_summary()
    assert summary
    schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
    for topic in ("/inputs", "/outputs"):
        properties = json.loads(schemas[topic].data)["properties"]
        assert {name: of["unit"] for name, of in properties.items()} == {
            name: result.units[name] for name in properties
        }
    assert {t: s.name for t, s in schemas.items() if t not in ("/inputs", "/outputs")} == {
        "/tf": "foxglove.FrameTransforms",
        "/pose": "foxglove.PoseInFrame",
        "/scene": "foxglove.SceneUpdate",
    }


@pytest.mark.parametrize(
    ("phi", "theta", "psi"), [(0.0, 0.0, 0.0), (0.0, 0.0, pi / 2), (0.3, -0.4, 2.5), (3.0, 1.2, -1)]
)
def test_frames(heavy: VehicleModel, phi: float, theta: float, psi: float) -> None:
    """In `map`, x is east, y north and z up; the vehicle's x points forward, y to port and z up."""
    result = recorded(heavy, 0.0 + 0.1, {}, x=1.0, y=2.0, z=3.0, phi_0=phi, theta_0=theta, psi_0=psi)
    first = messages(heavy.to_mcap(result))["/pose"][0][1]
    assert first.frame_id == "map"
    at, q = first.pose.position, first.pose.orientation
    assert (at.x, at.y, at.z) == (2.0, 1.0, -3.0)
    # The unit vectors of the body in north-east-down (Fossen 2021, (2.31)), written with east, north, up.
    forward = (cos(theta) * sin(psi), cos(theta) * cos(psi), sin(theta))
    down_n = cos(phi) * sin(theta) * cos(psi) + sin(phi) * sin(psi)
    down_e = cos(phi) * sin(theta) * sin(psi) - sin(phi) * cos(psi)
    up = (-down_e, -down_n, cos(phi) * cos(theta))
    x, y, z, w = q.x, q.y, q.z, q.w
    matrix = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    np.testing.assert_allclose(matrix[:, 0], forward, atol=1e-12)
    np.testing.assert_allclose(matrix[:, 2], up, atol=1e-12)
    np.testing.assert_allclose(matrix[:, 1], np.cross(up, forward), atol=1e-12)


def test_transform_is_the_pose(heavy: VehicleModel) -> None:
    """/tf says the same as /pose, from `map` to `base_link`."""
    found = messages(heavy.to_mcap(recorded(heavy, 1.0, {"u_1": 0.4, "u_7": -0.2})))
    for (_, tf), (_, pose) in zip(found["/tf"], found["/pose"], strict=True):
        (transform,) = tf.transforms
        assert (transform.parent_frame_id, transform.child_frame_id) == ("map", "base_link")
        assert str(transform.rotation) == str(pose.pose.orientation)
        assert str(transform.translation) == str(pose.pose.position)


def test_jets_leave_against_the_force() -> None:
    """Each thruster that pushes has an arrow at its place, whose x axis points where the water goes."""
    vehicle = rov_fmu.load("videoray")
    result = recorded(vehicle, 1.0, {"u_l": 0.5, "u_t": -0.5})
    _, scene = messages(vehicle.to_mcap(result))["/scene"][-1]
    (entity,) = scene.entities
    assert entity.frame_id == "base_link"
    assert entity.frame_locked
    forces = {t.name: result[f"F_{t.name}"][-1] for t in vehicle.layout.thrusters}
    pushing = [t for t in vehicle.layout.thrusters if forces[t.name]]
    assert {t.name for t in pushing} == {"l", "t"}
    longest = max(map(abs, forces.values()))
    lengths = []
    for thruster, arrow in zip(pushing, entity.arrows, strict=True):
        q = arrow.pose.orientation
        x_axis = np.array([1 - 2 * (q.y**2 + q.z**2), 2 * (q.x * q.y + q.z * q.w), 2 * (q.x * q.z - q.y * q.w)])
        forward, starboard, down = thruster.direction.value
        against = -np.sign(forces[thruster.name]) * np.array([forward, -starboard, -down])
        np.testing.assert_allclose(x_axis, against, atol=1e-12)
        lengths.append((arrow.shaft_length + arrow.head_length) / abs(forces[thruster.name]) * longest)
    assert lengths[0] == pytest.approx(lengths[1])
    left = next(a for t, a in zip(pushing, entity.arrows, strict=True) if t.name == "l")
    assert left.pose.position.y > 0.0  # port


def test_without_the_library(heavy: VehicleModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where foxglove-sdk is missing, a line says how to install it."""
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(InputError, match=r"pip install 'rov-fmu\[ros\]'"):
        heavy.to_mcap(recorded(heavy, 0.1, {}))


def test_command(tmp_path: Path) -> None:
    """`rov-fmu simulate -o run.mcap` writes the commands and the motion."""
    target = tmp_path / "a run.mcap"
    assert main(["simulate", "videoray", "--set", "u_l=0.3", "--set", "u_r=0.3", "--stop", "2", "-o", str(target)]) == 0
    found = messages(target.read_bytes())
    assert found["/inputs"][0][1]["u_l"] == 0.3
    assert 0.45 < found["/outputs"][-1][1]["u"] < 0.4729  # V_ss of the coefficients of Table 9
    assert len(found["/outputs"]) == 201
    assert len(found["/scene"]) == 51  # 25 a second


def test_identification() -> None:
    """A log has its commands, the predictions with their 95 % bands, and the unknown force, all from its own time 0."""
    result = example()
    prediction = next(p for axis in result.axes for p in axis.predictions if p.is_judged)
    unknown = UnknownForce(SURGE, prediction.file, np.array([1.0, 2.5]), np.array([0.5, -1.0]), np.array([0.1, 0.2]))
    content = identification_mcap(replace(result, unknown_forces=(unknown,)))
    found = messages(content)
    log = "/" + prediction.file.replace(".", "_")
    assert {topic.split("/")[1] for topic in found} == {one.file.replace(".", "_") for one in result.folder.logs}
    assert found[f"{log}/unknown_force/surge"] == [
        (1_000_000_000, {"force": 0.5, "low": pytest.approx(0.304, rel=1e-4), "high": pytest.approx(0.696, rel=1e-4)}),
        (
            2_500_000_000,
            {"force": -1.0, "low": pytest.approx(-1.392, rel=1e-4), "high": pytest.approx(-0.608, rel=1e-4)},
        ),
    ]
    written = found[f"{log}/{prediction.quantity.replace(' ', '_')}"]
    assert [values["measured"] for _, values in written] == prediction.measured.tolist()
    assert [values["predicted"] for _, values in written] == prediction.predicted.tolist()
    inside = np.array([values["low"] <= values["measured"] <= values["high"] for _, values in written])
    off = np.abs(prediction.measured - prediction.predicted)
    assert inside.mean() == pytest.approx(np.mean(off <= 1.959964 * prediction.deviation))
    commands = next(one.commands for one in result.folder.logs if one.file == prediction.file)
    assert commands
    assert [values["t"] for _, values in found[f"{log}/commands"]] == commands.value.tolist()


def test_measured_poses_of_a_log() -> None:
    """The bow points north-west, up and to port: its direction and the depth are those of the angles."""
    result, time = example(), np.arange(0.0, 5.0, 0.1)
    phi, theta, psi = 0.2, 0.3, 2.0 * pi - pi / 4
    angles = {"roll angle": phi, "pitch angle": theta, "heading": psi, "depth": 1.5}
    channels = tuple(Channel(QUANTITIES[q], Source(q), time, np.full(len(time), x)) for q, x in angles.items())
    log = replace(result.folder.logs[0], channels=channels)
    found = messages(identification_mcap(replace(result, folder=replace(result.folder, logs=[log]))))
    poses_of_log = found[f"/{log.file.replace('.', '_')}/pose"]
    assert len(poses_of_log) == len(time)
    pose = poses_of_log[0][1]
    assert pose.frame_id == "map"
    assert (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z) == (0.0, 0.0, -1.5)
    q = pose.pose.orientation
    bow = [1.0 - 2.0 * (q.y**2 + q.z**2), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y)]
    assert bow == pytest.approx([cos(theta) * sin(psi), cos(theta) * cos(psi), sin(theta)])


def test_identify_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`rov-fmu identify --mcap` writes the file; another suffix is refused before the work begins."""
    folder = small_folder(tmp_path / "tests")
    assert main(["identify", str(folder), "--mcap", str(tmp_path / "logs.bag")]) == 2
    assert "--mcap" in (refusal := capsys.readouterr().err)
    assert "must end with .mcap" in refusal
    assert main(["identify", str(folder), "--mcap", str(tmp_path / "logs.mcap")]) == 0
    assert make_reader(BytesIO((tmp_path / "logs.mcap").read_bytes())).get_header()


def test_a_flight_with_ardusub_is_a_motion(heavy: VehicleModel, tmp_path: Path) -> None:
    """The log of a flight has the pulses of ArduSub as commands, and the motion that they cause."""
    setup = Setup(heavy, servos_of(heavy.layout, None, {}), log=tmp_path / "flight.mcap", log_interval=0.1)
    flight = Flight(setup, 1000)
    for count in range(401):
        flight.step(ServoPacket(100, count, (1700, 1300) + (1500,) * 14))
    assert flight.log
    flight.log.write(tmp_path / "flight.mcap")
    found = messages((tmp_path / "flight.mcap").read_bytes())
    assert found["/inputs"][0][1]["u_1"] == pytest.approx(0.5)
    assert found["/inputs"][0][1]["u_2"] == pytest.approx(-0.5)
    times = np.array([stamp for stamp, _ in found["/outputs"]]) * 1e-9
    assert np.diff(times) == pytest.approx(0.1)
    pushed = {"u_1": 0.5, "u_2": -0.5}
    expected = heavy.simulate([0.0, *times], pushed)
    for name in ("u", "r", "F_1"):
        values = [row[name] for _, row in found["/outputs"]]
        assert values == pytest.approx(expected[name][1:], abs=1e-9)
