"""Whether velocity and position agree: offsets and scales are seen, and nothing is seen where there is none.

The motion is a sum of sines with its integral in closed form, so that no sum stands for the position.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from rov_fmu.equation.catalogue import SURGE, Axis
from rov_fmu.identify.findings import sentences
from rov_fmu.tank.agreement import disagreement
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.channels import Topic, channels_of
from rov_fmu.tank.log import Log, Source
from rov_fmu.tank.quality import checked
from tests.tank.logs import channel, used
from tests.tank.readers.motion import HEADING, PITCH, ROLL

TIME: Array = np.arange(0.0, 120.0, 0.1)
KINDS = ("exact", "noisy", "coloured", "late", "outliers", "wandering", "reset", "dead reckoning")
"""What healthy sensors of a position do."""


def moved(seed: int, time: Array) -> tuple[Array, Array]:
    """The position and the velocity to the north, to the east and down, n x 3."""
    random = np.random.default_rng(seed)
    rate, size, phase = (random.uniform(*ends, (5, 3)) for ends in ((0.1, 0.8), (-0.3, 0.3), (0.0, 6.0)))
    angle = time[:, None, None] * rate + phase
    return (size / rate * np.sin(angle)).sum(axis=1), (size * np.cos(angle)).sum(axis=1)


def sensed(kind: str, seed: int) -> tuple[Array, Array]:
    """The position and the velocity of healthy sensors, n x 3. A velocity has white noise of 1 cm/s."""
    random = np.random.default_rng(100 + seed)
    position, velocity = moved(seed, TIME)
    noise = random.standard_normal(position.shape)
    if kind == "exact":
        return position, velocity
    velocity = velocity + 0.01 * random.standard_normal(velocity.shape)
    if kind == "noisy":
        position = position + 0.05 * noise
    elif kind == "coloured":  # as the estimator of an autopilot wanders about the truth
        for n in range(1, len(noise)):
            noise[n] = 0.98 * noise[n - 1] + np.sqrt(1.0 - 0.98**2) * noise[n]
        position = position + 0.03 * noise
    elif kind == "late":
        position = moved(seed, TIME - 0.5)[0] + 0.02 * noise
    elif kind == "outliers":
        position = position + 0.3 * noise + np.where(random.random(position.shape) < 0.02, 5.0, 0.0)
    elif kind == "wandering":
        position = position + 0.003 * np.cumsum(noise, axis=0)
    elif kind == "reset":
        position = position + 0.02 * noise + np.where(TIME > 71.3, 2.0, 0.0)[:, None]
    elif kind == "dead reckoning":
        position = np.cumsum(0.1 * velocity, axis=0)
    return position, velocity


@pytest.mark.parametrize("kind", KINDS)
def test_healthy_sensors_are_not_accused(kind: str) -> None:
    for seed in range(20):
        found = disagreement(TIME, *sensed(kind, seed))
        assert found
        assert not found.moved.any(), (seed, found)
        assert not found.scaled.any(), (seed, found)


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_an_offset_of_2_cm_per_s_and_a_scale_of_3_percent_are_seen(kind: str) -> None:
    """Each along its own axis, unless the sensor of the position is too bad to tell it."""
    for seed in range(3):
        position, velocity = sensed(kind, seed)
        found = disagreement(TIME, position, velocity * [1.0, 1.03, 1.0] - [0.02, 0.0, 0.0])
        assert found
        assert found.offset[0] == pytest.approx(0.02, abs=max(0.001, 3.0 * found.offset_errors[0]))
        assert found.scale[1] == pytest.approx(1.0 / 1.03, abs=max(0.002, 3.0 * found.scale_errors[1]))
        if kind not in ("outliers", "wandering"):
            assert found.moved.tolist() == [True, False, False]
            assert found.scaled.tolist() == [False, True, False] or kind in ("coloured", "noisy")


def estimates(position: Array, velocity: Array, angles: Array) -> Topic:
    """The messages of an autopilot's estimator, in its earth frame."""
    names = ("PN", "PE", "PD", "VN", "VE", "VD", "Roll", "Pitch", "Yaw")
    columns = np.hstack([position, velocity, np.degrees(angles)])
    return Topic(Source("XKF1", "XKF1"), TIME, dict(zip(names, columns.T, strict=True)))


def of_body(position: Array, velocity: Array, angles: Array) -> Topic:
    """The odometry of a robot, with the velocity in its own frame."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("ZYX", angles[:, ::-1])
    q = rotation.as_quat(scalar_first=True)
    columns = np.hstack([q, position, velocity])
    names = [f"{name}[{n}]" for name, count in (("q", 4), ("position", 3), ("velocity", 3)) for n in range(count)]
    source = Source("/odom", "vehicle_odometry", frames=("ned", "frd"))
    return Topic(source, TIME, dict(zip(names, columns.T, strict=True)))


ANGLES = np.column_stack([np.interp(TIME, np.linspace(0.0, 120.0, 100), a) for a in (ROLL, PITCH, 5.0 * HEADING)])


@pytest.mark.parametrize("is_earth", [True, False])
def test_velocities_in_the_messages_of_positions_are_corrected_and_told_once(is_earth: bool) -> None:
    """The channels are those of the velocity without its offset. A log without the offset stays as it is."""
    from scipy.spatial.transform import Rotation

    position, velocity = sensed("noisy", 1)
    own = velocity if is_earth else Rotation.from_euler("ZYX", ANGLES[:, ::-1]).inv().apply(velocity)
    make = estimates if is_earth else of_body
    right = channels_of([make(position, own, ANGLES)], None)
    assert not any(c.corrected for c in right)
    wrong = channels_of([make(position, own - [0.02, 0.0, 0.0], ANGLES)], None)
    for name in ("surge velocity", "sway velocity", "heave velocity"):
        before, after = (next(c for c in some if c.quantity.name == name) for some in (right, wrong))
        assert after.values == pytest.approx(before.values, abs=0.004)
    told = checked(Log("dive.bin", None, tuple(wrong))).findings
    which = "XKF1" if is_earth else "/odom"
    (sentence,) = sentences(told, "velocity corrected")
    assert sentence.startswith(f"dive.bin: the velocity of {which} is corrected by +2")
    assert f"cm/s {'to the north' if is_earth else 'forward'}, because the position changes so much faster" in sentence


def test_a_position_of_another_scale_moves_no_velocity() -> None:
    """Such as a distance to the north beside the velocity of a vehicle that turns: one of the two is something else."""
    position, velocity = (values[:, 0] for values in sensed("noisy", 2))
    found = checked(
        Log("a.csv", None, (channel("depth", TIME, 3.0 * position), channel("heave velocity", TIME, velocity + 0.05)))
    )
    assert not used(found, "heave velocity").corrected
    assert {f.kind for f in found.findings} >= {"scales differ"}


def test_a_position_that_stays_0_says_nothing() -> None:
    position, velocity = sensed("noisy", 1)
    channels = channels_of([estimates(0.0 * position, velocity + 0.05, ANGLES)], None)
    assert not any(c.corrected for c in channels)


@pytest.mark.parametrize(
    ("quantities", "axis", "offset", "words"),
    [
        (("depth", "heave velocity"), None, 0.02, "+2 cm/s"),
        (("surge distance", "surge velocity"), None, -0.03, "-3 cm/s"),
        (("heading", "yaw velocity"), None, 0.02, "+1.1 deg/s"),
        (("depth", "heave velocity"), None, 0.0, ""),
        (("surge distance", "surge velocity"), SURGE, 0.03, ""),
    ],
)
def test_columns_of_one_axis_are_corrected(
    quantities: Sequence[str], axis: Axis | None, offset: float, words: str
) -> None:
    """In a log of surge alone, a current may be between them."""
    position, velocity = (values[:, 0] for values in sensed("noisy", 2))
    positions, speeds = channel(quantities[0], TIME, position), channel(quantities[1], TIME, velocity - offset)
    found = checked(Log("a.csv", None, (positions, speeds), axis))
    speed = used(found, quantities[1])
    expected = [float(words.split(maxsplit=1)[0])] if words else []
    assert [float(text) for text in speed.corrected.split()[:1]] == pytest.approx(expected, abs=0.11)
    assert speed.corrected.split()[1:] == words.split()[1:]
    assert speed.values == pytest.approx(velocity if words else velocity - offset, abs=0.003)
    assert [f.words["velocity"] for f in found.findings if f.kind == "velocity corrected"] == [quantities[1]] * bool(
        words
    )
