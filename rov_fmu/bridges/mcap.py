"""Motions as MCAP files, which Foxglove, PlotJuggler and Rerun open.

The frames are those of REP 103 and REP 105, which these programs expect: `map` is east-north-up, and `base_link`, the
frame of the vehicle, is forward-left-up. With the FMU's body frame (forward, starboard, down) and earth frame (north,
east, down), the rotation from `base_link` to `map` is

    T R diag(1, -1, -1),   T = [[0, 1, 0], [1, 0, 0], [0, 0, -1]],

where R is the rotation from the FMU's body frame to its earth frame. Positions and orientations use Foxglove's
schemas; all other variables are JSON with the names and units of the FMU, with north, east, and down as there.

Its import raises InputError where foxglove-sdk is not installed.
"""

from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from math import inf

import numpy as np
from scipy.spatial.transform import Rotation

from rov_fmu.c.simulation import Array
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import UPWARD, Declaration
from rov_fmu.io.messages import InputError
from rov_fmu.report.plots.geometry import hull_size, thruster_place
from rov_fmu.vehicle.vehicle import Vehicle

try:
    from foxglove import Channel, Context, open_mcap
    from foxglove.channels import FrameTransformsChannel, PoseInFrameChannel, SceneUpdateChannel
    from foxglove.mcap import MCAPWriteOptions
    from foxglove.messages import (
        ArrowPrimitive,
        Color,
        CubePrimitive,
        FrameTransform,
        FrameTransforms,
        Pose,
        PoseInFrame,
        Quaternion,
        SceneEntity,
        SceneUpdate,
        Timestamp,
        Vector3,
    )
except ImportError as error:
    raise InputError("MCAP needs foxglove-sdk: pip install 'rov-fmu[ros]'") from error

EARTH = "map"
"""The name of the frame that is fixed to the earth: east, north, up."""
BODY = "base_link"
"""The name of the frame of the vehicle: forward, left, up. It is the same for all vehicles, so layouts fit all."""
_TO_ENU = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""The rotation from north-east-down to east-north-up."""
_TO_FRD = Rotation.from_matrix(np.diag(UPWARD[:3]))
"""The rotation from forward-left-up to forward-starboard-down, which is its own inverse."""
_SCENE_INTERVAL = 0.04
"""The least time between two pictures of the vehicle, s: 25 pictures a second look smooth."""
_LONGEST_JET = 1.5
"""The length of the longest jet, relative to the size of the vehicle."""
_HULL, _JET = (0.93, 0.69, 0.13, 0.8), (0.34, 0.71, 0.91, 0.9)
"""The colours of the hull and of the jets: red, green, blue and opacity."""


class Recording:
    """An MCAP file in memory."""

    def __init__(self, about: Mapping[str, str], profile: str = "") -> None:
        """Begin a file with metadata about the vehicle, and with a profile, which tells what kind of file it is."""
        self.context, self._stream = Context(), BytesIO()
        options = MCAPWriteOptions(profile=profile, compression_threads=0)  # the bytes do not depend on the machine
        self._writer = open_mcap(self._stream, context=self.context, writer_options=options)
        self._writer.write_metadata("vehicle", dict(about))

    def topic(self, name: str, numbers: Mapping[str, Declaration]) -> Callable[[int, Mapping[str, float]], None]:
        """Return the function that writes a message of a topic with numbers by name, at a time in ns."""
        schema = {
            "title": name.removeprefix("/"),
            "type": "object",
            "properties": {
                key: {"type": "number", "unit": number.unit, "description": f"{number.description} [{number.unit}]"}
                for key, number in numbers.items()
            },
        }
        channel = Channel(name, schema=schema, message_encoding="json", context=self.context)
        return lambda stamp, values: channel.log(dict(values), log_time=stamp)

    def poses(self, name: str, values: Mapping[str, Array]) -> Callable[[int, int], None]:
        """Return the function that writes the n-th pose of a topic, with its stamp in ns, from values as in `poses`."""
        channel = PoseInFrameChannel(name, context=self.context)
        positions, orientations = poses(values)

        def write(n: int, stamp: int) -> None:
            pose = _pose(positions[n], orientations[n])
            channel.log(PoseInFrame(timestamp=_timestamp(stamp), frame_id=EARTH, pose=pose), log_time=stamp)

        return write

    def content(self) -> bytes:
        """End the file, and return its content."""
        self._writer.close()
        return self._stream.getvalue()


def about_vehicle(vehicle: Vehicle) -> dict[str, str]:
    """Return what a file says about its vehicle."""
    return {"name": vehicle.name, "version": vehicle.version, "source": vehicle.source}


def motion_mcap(vehicle: Vehicle, time: Array, values: Mapping[str, Array]) -> bytes:
    """Return a motion of a vehicle as the content of an MCAP file.

    `time` has the times (s), and `values` the value of each variable at each of them, by the names of the FMU and in
    its units. The topics are `/tf`, `/pose` and `/scene` with Foxglove's schemas, and `/inputs` and `/outputs` with
    numbers by name. A coordinate of the pose that the vehicle does not have, such as the depth without heave, is 0.
    Inputs are held, so they are written when one of them changes.
    """
    recording = Recording(about_vehicle(vehicle))
    layout = vehicle.layout
    groups = {"/inputs": layout.inputs, "/outputs": layout.state | layout.calculated}
    numbers = {
        topic: {name: of for name, of in declared.items() if name in values} for topic, declared in groups.items()
    }
    write = {topic: recording.topic(topic, own) for topic, own in numbers.items() if own}
    write_picture, write_pose = _picture_writer(vehicle, values, recording.context), recording.poses("/pose", values)
    before: dict[str, float] = {}
    for n, stamp in enumerate(nanoseconds(time)):
        write_picture(n, stamp)
        write_pose(n, stamp)
        row = {topic: {name: float(values[name][n]) for name in own} for topic, own in numbers.items()}
        if row["/inputs"] != before:
            before = row["/inputs"]
            write["/inputs"](stamp, before)
        if row["/outputs"]:
            write["/outputs"](stamp, row["/outputs"])
    return recording.content()


def nanoseconds(time: Array) -> list[int]:
    """Return times in seconds as whole nanoseconds."""
    return [round(t) for t in (1e9 * time).tolist()]


def poses(values: Mapping[str, Array]) -> tuple[Array, Rotation]:
    """Return the positions (times, 3) and the orientations of a vehicle in the frame `map`.

    The variables are those of the FMU: x, y, z in m, and the quaternion or the Euler angles phi, theta, psi in rad.
    """
    zero = np.zeros_like(next(iter(values.values())))
    north, east, down = (values.get(name, zero) for name in "xyz")
    if values.keys() >= set(QUATERNION):
        turned = Rotation.from_quat(np.stack([values[name] for name in QUATERNION], axis=-1), scalar_first=True)
    else:
        angles = [values.get(name, zero) for name in ("psi", "theta", "phi")]
        turned = Rotation.from_euler("ZYX", np.stack(angles, axis=-1))
    return np.stack([east, north, 0.0 - down], axis=-1), _TO_ENU * turned * _TO_FRD


def _picture_writer(vehicle: Vehicle, values: Mapping[str, Array], context: Context) -> Callable[[int, int], None]:
    """Return the function that writes frame and picture of the vehicle at the n-th time, with its stamp in ns."""
    tf = FrameTransformsChannel("/tf", context=context)
    scene = SceneUpdateChannel("/scene", context=context)
    positions, orientations = poses(values)
    forces = {t.name: values[f"F_{t.name}"] for t in vehicle.layout.thrusters if f"F_{t.name}" in values}
    strongest = max((float(np.nanmax(np.abs(force))) for force in forces.values()), default=0.0)
    size = hull_size(vehicle)
    due = -inf

    def write(n: int, stamp: int) -> None:
        nonlocal due
        transform = FrameTransform(
            timestamp=_timestamp(stamp),
            parent_frame_id=EARTH,
            child_frame_id=BODY,
            translation=_vector(positions[n]),
            rotation=_quaternion(orientations[n]),
        )
        tf.log(FrameTransforms(transforms=[transform]), log_time=stamp)
        if stamp >= due:
            shares = {name: float(force[n]) / strongest if strongest else 0.0 for name, force in forces.items()}
            scene.log(SceneUpdate(entities=[_picture(vehicle, size, shares)]), log_time=stamp)
            due = stamp + round(1e9 * _SCENE_INTERVAL)

    return write


def _picture(vehicle: Vehicle, size: Array, shares: Mapping[str, float]) -> SceneEntity:
    """Return a picture of the vehicle: a hull of some size, and for each thruster its jet against the force.

    `shares` are the forces relative to the strongest one.
    """
    middle = _pose(np.zeros(3), Rotation.identity())
    return SceneEntity(
        frame_id=BODY,
        id="vehicle",
        frame_locked=True,
        cubes=[CubePrimitive(pose=middle, size=_vector(size), color=_colour(_HULL))],
        arrows=[*_jets(vehicle, shares, _LONGEST_JET * float(size.max()))],
    )


def _jets(vehicle: Vehicle, shares: Mapping[str, float], longest: float) -> Iterator[ArrowPrimitive]:
    """Yield the jets as arrows in the frame of the vehicle. An arrow of Foxglove points along its own x axis."""
    for thruster in vehicle.layout.thrusters:
        share = shares.get(thruster.name, 0.0)
        if share == 0.0:
            continue
        jet = _TO_FRD.apply(np.multiply(-np.sign(share), thruster.direction.value))
        turned, _ = Rotation.align_vectors([jet], [[1.0, 0.0, 0.0]])
        length = abs(share) * longest
        yield ArrowPrimitive(
            pose=_pose(_TO_FRD.apply(thruster_place(vehicle, thruster)), turned),
            shaft_length=0.8 * length,
            shaft_diameter=0.04 * longest,
            head_length=0.2 * length,
            head_diameter=0.08 * longest,
            color=_colour(_JET),
        )


def _timestamp(stamp: int) -> Timestamp:
    return Timestamp(*divmod(stamp, 1_000_000_000))


def _pose(position: Array, orientation: Rotation) -> Pose:
    return Pose(position=_vector(position), orientation=_quaternion(orientation))


def _vector(of: Array) -> Vector3:
    return Vector3(**dict(zip("xyz", of.tolist(), strict=True)))


def _quaternion(of: Rotation) -> Quaternion:
    return Quaternion(**dict(zip("xyzw", of.as_quat().tolist(), strict=True)))


def _colour(of: tuple[float, float, float, float]) -> Color:
    return Color(**dict(zip("rgba", of, strict=True)))
