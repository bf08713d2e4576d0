"""MCAP files, read back with the public reader: numbers, units, frames and pictures."""

import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rov_fmu
from rov_fmu.bridges.mcap_logs import identification_mcap
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.result import UnknownForce
from rov_fmu.interface.model import VehicleModel
from rov_fmu.interface.result import Result
from rov_fmu.io.messages import InputError
from rov_fmu.tank.readers.listing import Listing, list_files
from tests.bridges.test_sdf import turned_in_gazebo
from tests.folders import small_folder
from tests.report.results import example
from tests.tank.logs import channel, commands, log


def recorded(vehicle: VehicleModel, seconds: float, inputs: Mapping[str, Any], **start: float) -> Result:
    """Return a simulation with all inputs and outputs, every 0.1 s."""
    layout = vehicle.layout
    names = [*layout.inputs, *layout.state, *layout.calculated]
    return vehicle.simulate(np.arange(0.0, seconds + 0.05, 0.1), inputs, start=start, record=names)


def messages(content: bytes) -> dict[str, list[tuple[int, Any]]]:
    """Return the stamps (ns) and the messages of each topic."""
    found: dict[str, list[tuple[int, Any]]] = {}
    reader = make_reader(BytesIO(content), validate_crcs=True, decoder_factories=[DecoderFactory()])
    for _, of, message in reader.iter_messages():
        if of.message_encoding == "json":
            decoded = json.loads(message.data)
        else:
            decoded = DecoderFactory().decoder_for(of.message_encoding, _)(message.data)  # type: ignore[misc]
        found.setdefault(of.topic, []).append((message.log_time, decoded))
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
    (stamp,) = (tf.timestamp for tf in found["/tf"][-1][1].transforms)
    assert (stamp.seconds, stamp.nanos) == (2, 0)
    assert heavy.to_mcap(pd.DataFrame({**result, "t": result.time, "run": 7})) == content
    summary = make_reader(BytesIO(content)).get_summary()
    assert summary
    schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
    for topic in ("/inputs", "/outputs"):
        properties = json.loads(schemas.pop(topic).data)["properties"]
        assert {name: of["unit"] for name, of in properties.items()} == {n: result.units[n] for n in properties}
    assert {topic: schema.name for topic, schema in schemas.items()} == {
        "/tf": "foxglove.FrameTransforms",
        "/pose": "foxglove.PoseInFrame",
        "/scene": "foxglove.SceneUpdate",
    }


def turned(pose: Any) -> NDArray[np.float64]:
    """The axes of the vehicle (forward, to port, up) in the frame `map`: east, north and up."""
    q = pose.orientation
    return np.asarray(Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix())


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.0, 0.0, pi / 2), (0.3, -0.4, 2.5), (3.0, 1.2, -1.0)])
def test_frames(heavy: VehicleModel, angles: tuple[float, float, float]) -> None:
    """In `map`, x is east, y north and z up; the vehicle's x points forward, y to port and z up."""
    start = dict(zip(("phi_0", "theta_0", "psi_0"), angles, strict=True))
    first = messages(heavy.to_mcap(recorded(heavy, 0.1, {}, x=1.0, y=2.0, z=3.0, **start)))["/pose"][0][1]
    assert first.frame_id == "map"
    at = first.pose.position
    assert (at.x, at.y, at.z) == (2.0, 1.0, -3.0)
    np.testing.assert_allclose(turned(first.pose), turned_in_gazebo(*angles), atol=1e-12)


def test_level_frames_and_the_picture_with_the_jets(heavy: VehicleModel) -> None:
    """A jet leaves its thruster against the force; the longest one has 1.5 times the length of the hull."""
    videoray = rov_fmu.load("videoray")
    at_rest = messages(videoray.to_mcap(recorded(videoray, 0.1, {}, x=1.0, z=3.0, psi=2.5)))
    np.testing.assert_allclose(turned(at_rest["/pose"][0][1].pose), turned_in_gazebo(0.0, 0.0, 2.5), atol=1e-12)
    assert not at_rest["/scene"][0][1].entities[0].arrows
    found = messages(heavy.to_mcap(recorded(heavy, 0.1, {"u_5": 0.5, "u_1": -0.2}, x=1.0, z=3.0)))
    ((_, moved),) = found["/tf"][-1:]
    (tf,) = moved.transforms
    last = found["/pose"][-1][1].pose
    assert (tf.parent_frame_id, tf.child_frame_id) == ("map", "base_link")
    assert f"{tf.translation}{tf.rotation}" == f"{last.position}{last.orientation}"
    (picture,) = found["/scene"][-1][1].entities
    (hull,) = picture.cubes
    size = np.array([hull.size.x, hull.size.y, hull.size.z])
    places = {t.name: np.array(t.place) for t in heavy.layout.thrusters}
    assert np.all(2.0 * np.abs([*places.values()]).max(axis=0) <= size)
    assert size == pytest.approx([0.312, 0.436, 0.17])
    forces = {name: found["/outputs"][-1][1][f"F_{name}"] for name in ("1", "5")}
    for jet, name in zip(picture.arrows, forces, strict=True):
        direction = np.array(next(t.direction.value for t in heavy.layout.thrusters if t.name == name))
        assert turned(jet.pose)[:, 0] == pytest.approx(-np.sign(forces[name]) * direction * [1.0, -1.0, -1.0])
        at = jet.pose.position
        assert [at.x, at.y, at.z] == pytest.approx(places[name] * [1.0, -1.0, -1.0])
        share = abs(forces[name]) / max(map(abs, forces.values()))
        assert jet.shaft_length + jet.head_length == pytest.approx(1.5 * size.max() * share)


def test_without_the_library(heavy: VehicleModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where foxglove-sdk is missing, a line says how to install it."""
    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "rov_fmu.bridges.mcap", raising=False)
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


def test_identification(tmp_path: Path) -> None:
    """A log has its commands, the predictions with their 95 % bands, and the unknown force, all from its own time 0."""
    result = example()
    prediction = next(p for axis in result.axes for p in axis.predictions if p.is_judged)
    unknown = UnknownForce(SURGE, prediction.file, np.array([1.0, 2.5]), np.array([0.5, -1.0]), np.array([0.1, 0.2]))
    content = identification_mcap(replace(result, unknown_forces=(unknown,)))
    (tmp_path / "logs.mcap").write_bytes(content)
    assert list_files(tmp_path) == Listing(tmp_path), "the next identification does not take it for a log"
    found = messages(content)
    topic = "/" + prediction.file.replace(".", "_")
    assert {topic.split("/")[1] for topic in found} == {one.file.replace(".", "_") for one in result.folder.logs}
    shown = [(stamp, *values.values()) for stamp, values in found[f"{topic}/unknown_force/surge"]]
    expected = [(1e9, 0.5, 0.304, 0.696), (2.5e9, -1.0, -1.392, -0.608)]
    np.testing.assert_allclose(shown, expected, rtol=1e-4)
    written = found[f"{topic}/{prediction.quantity.replace(' ', '_')}"]
    assert [values["measured"] for _, values in written] == prediction.measured.tolist()
    assert [values["predicted"] for _, values in written] == prediction.predicted.tolist()
    inside = np.array([values["low"] <= values["measured"] <= values["high"] for _, values in written])
    off = np.abs(prediction.measured - prediction.predicted)
    assert inside.mean() == pytest.approx(np.mean(off <= 1.959964 * prediction.deviation))
    commanded = next(one.commands for one in result.folder.logs if one.file == prediction.file)
    assert commanded
    assert [values["t"] for _, values in found[f"{topic}/commands"]] == commanded.value.tolist()


def test_a_log_with_a_heading_has_its_pose_and_begins_at_0() -> None:
    """The depth and the roll are those between the samples, and the heading turns on through half a turn."""
    result, time = example(), np.array([5.0, 6.0, 7.0])
    dive = log(
        commands(np.array([4.0, 6.0, 7.0]), {"t": np.array([0.5, 0.5, 0.2])}),
        channel("heading", time, np.array([3.0, -3.0, -2.5])),
        channel("depth", time[::2], np.array([1.0, 3.0])),
        channel("roll angle", time[::2], np.array([0.1, 0.3])),
        file="dive.csv",
    )
    content = identification_mcap(replace(result, folder=replace(result.folder, logs=[*result.folder.logs, dive])))
    found = messages(content)
    assert found["/dive_csv/commands"] == [(0, {"t": 0.5}), (3_000_000_000, {"t": 0.2})]
    assert found["/dive_csv/depth"] == [(1_000_000_000, {"measured": 1.0}), (3_000_000_000, {"measured": 3.0})]
    assert [stamp for stamp, _ in found["/dive_csv/pose"]] == [1_000_000_000, 2_000_000_000, 3_000_000_000]
    for (_, of), depth, *angles in zip(
        found["/dive_csv/pose"], (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (0.0, 0.0, 0.0), (3.0, -3.0, -2.5), strict=True
    ):
        assert of.pose.position.z == pytest.approx(-depth)
        np.testing.assert_allclose(turned(of.pose), turned_in_gazebo(*angles), atol=1e-12)


def test_identify_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`rov-fmu identify --mcap` writes the file; another suffix is refused before the work begins."""
    folder = small_folder(tmp_path / "tests")
    assert main(["identify", str(folder), "--mcap", str(tmp_path / "logs.bag")]) == 2
    assert "--mcap" in (refusal := capsys.readouterr().err)
    assert "must end with .mcap" in refusal
    assert main(["identify", str(folder), "--mcap", str(tmp_path / "logs.mcap")]) == 0
    assert make_reader(BytesIO((tmp_path / "logs.mcap").read_bytes())).get_header()
