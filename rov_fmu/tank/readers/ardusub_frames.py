"""The frames of ArduSub, and which servo drives which input of a vehicle."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import FAINT, Thruster
from rov_fmu.io.messages import InputError, listed, only
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding, about

DEMANDS = (ROLL, PITCH, YAW, HEAVE, SURGE, SWAY)
_TORQUES = 3
"""The number of rotations among the axes, which come first."""
_SIMPLE = ("..-.+.", "..+.+.", "+..-..", "-..-..", ".....+")
FRAMES: Mapping[str, Sequence[str]] = {
    "bluerov1": ("..-.+.", "..+.+.", "-+.+..", "++.+..", ".-.+..", "-....+"),
    "vectored": ("..+.-+", "..-.--", "..-.++", "..+.+-", "+..-..", "-..-.."),
    "vectored_6dof": ("..+.-+", "..-.--", "..-.++", "..+.+-", "+-.-..", "--.-..", "++.-..", "-+.-.."),
    "vectored_6dof_90deg": ("++.+..", "..+.+.", "+-.+..", ".....+", ".....+", "-+.+..", "..-.+.", "--.+.."),
    "simplerov_3": (*_SIMPLE[:2], "...-.."),
    "simplerov_4": _SIMPLE[:4],
    "simplerov_5": _SIMPLE,
}
"""The signs of the factors of each motor for roll, pitch, yaw, throttle (up), forward and lateral (to starboard).

They are those of `AP_Motors6DOF::setup_motors` in ArduPilot 4.7. The first frame is FRAME_CONFIG 0, the next one 1, and
so on."""
_ALSO_DRIVEN = {"simplerov_4": 5}
"""The last motor that ArduSub drives in a frame, where a vehicle with this frame does not have it."""

Servos = Mapping[str, tuple[int, float]]
"""For each input of the vehicle that a servo drives, the number of the servo from 1 on, and 1, or -1 if reversed."""

_IMPOSSIBLE, _WRITTEN, _AGREES, _NAMED = -1e6, 1000.0, 10.0, 1.0
"""The values by which motors and thrusters are matched: of a pair that is impossible, of one that `--servo` names, of
each torque that agrees, and of a name that is the number of the motor. One of a kind outweighs all of the next kind."""
_ADVICE = ": write --servo NUMBER=THRUSTER for each servo"


def servos_of(layout: Layout, frame: str | None, table: Mapping[int, str]) -> Servos:
    """Return the servos that drive the inputs of a vehicle.

    `frame` is the name of one of ArduSub's frames, whose motor n is servo n. The default is the first frame that fits:
    each of its motors drives one thruster, and each thruster is driven. `table` maps servos to thrusters, fins or other
    inputs by name, instead of the frame or in addition to it; a minus before a name reverses it. Raises InputError,
    also where the frame leaves open which thruster a servo drives.
    """
    servos: dict[str, tuple[int, float]] = {}
    for servo, name in table.items():
        key = f"u_{name.removeprefix('-')}"
        if key not in layout.commands:
            names = [command.removeprefix("u_") for command in layout.commands]
            raise InputError(f"--servo {servo}={name}: there is no such input{only(name.removeprefix('-'), names)}")
        if key in servos:
            raise InputError(f"--servo {servo}={name}: another servo drives this input")
        servos[key] = servo, -1.0 if name.startswith("-") else 1.0
    own = chosen_frame(layout, frame, table)
    if table and not own:
        return servos
    matched = own and _matched(layout, FRAMES[own], table)
    if not matched:
        if frame:
            raise InputError(f"--frame {frame}: the motors of this frame do not push as the thrusters do{_ADVICE}")
        raise InputError(f"VEHICLE: none of ArduSub's frames has these thrusters{_ADVICE}")
    driven, open_servos = matched
    free = {key: motor for key, motor in driven.items() if motor[0] not in table and key not in servos}
    if doubtful := {key: number for key, (number, _) in free.items() if number in open_servos}:
        numbers, keys = listed(map(str, sorted(doubtful.values()))), listed(sorted(doubtful))
        example = f"--frame {own} --servo {min(doubtful.values())}={min(doubtful).removeprefix('u_')}"
        raise InputError(
            f"--frame {own}: which of the servos {numbers} drives {keys} does not follow from the torques of these "
            f"thrusters: write for example {example}, or their positions into the vehicle file"
        )
    return free | servos


def chosen_frame(layout: Layout, frame: str | None, table: Mapping[int, str]) -> str:
    """Return the frame of `servos_of`, which has the same arguments; an empty text if there is none."""
    return frame or ("" if table else next(iter(fitting_frames(layout)), ""))


def fitting_frames(layout: Layout) -> list[str]:
    """Return the names of ArduSub's frames whose motors are the thrusters of a vehicle, and all that it can command."""
    count = len(layout.thrusters)
    if len(layout.commands) != count:
        return []
    return [name for name, motors in FRAMES.items() if len(motors) == count and _matched(layout, motors, {})]


def config_of(frame: str) -> str:
    """Return a frame with its parameter: `FRAME_CONFIG 1 (vectored)`."""
    return f"FRAME_CONFIG {[*FRAMES].index(frame)} ({frame})"


def frame_of(config: float | None) -> str:
    """Return the name of the frame of a FRAME_CONFIG; an empty text without one, and for a frame that is not known."""
    return next((name for number, name in enumerate(FRAMES) if number == config), "")


def impossible_of(frame: str) -> Array:
    """Return directions (k x motors) of outputs that no demands give to a frame, as far as no motor is clipped."""
    factors = np.array([["-.+".index(sign) - 1.0 for sign in motor] for motor in FRAMES.get(frame, ())]).reshape(-1, 6)
    left, singular, _ = np.linalg.svd(factors)
    return left[:, int((singular > 1e-9).sum()) :].T


def question_of(layout: Layout) -> str:
    """Return the question whether ArduSub has the frame that fits a vehicle."""
    own = listed(map(config_of, fitting_frames(layout)), "or")
    return f"does ArduSub have {own}?" if own else "does FRAME_CONFIG of ArduSub fit this vehicle?"


def motors_of(layout: Layout) -> int:
    """Return the number of the last motor that ArduSub drives in a frame that fits a vehicle; 0 if none fits."""
    return max((_ALSO_DRIVEN.get(name, len(FRAMES[name])) for name in fitting_frames(layout)), default=0)


def misfits(
    file: str, layout: Layout, without_pulse: Sequence[str], extra: Mapping[str, int], config: float | None
) -> Iterator[Finding]:
    """Yield findings if the motors of a log are not the thrusters of a vehicle, one for each axis that it concerns.

    `without_pulse` has the names of thrusters, `extra` the motors of the log for which there is no thruster, by words
    about them, and `config` is the FRAME_CONFIG of the log, or None.
    """
    frame = frame_of(config)
    motors = FRAMES.get(frame, ())
    fits = fitting_frames(layout)
    if frame in fits:
        extra = {words: motor for words, motor in extra.items() if motor > motors_of(layout)}
    frames = [f"the log has {config_of(frame)}"] if frame else []
    frames += [f"{config_of(own)} fits the vehicle" for own in fits if own != frame]
    words = f": {', and '.join(frames)}" if frames else ""
    factors = [motors[n - 1] if n <= len(motors) else "+" * len(DEMANDS) for n in extra.values()]
    pushed = {axis for axis in DEMANDS for t in layout.thrusters_along(axis) if t.name in without_pulse}
    pulled = {axis for motor in factors for axis, factor in zip(DEMANDS, motor, strict=True) if factor != "."}
    for kind, concerned, whose in (
        ("thrusters without pulse", pushed, listed(without_pulse)),
        ("motors without thruster", pulled, listed(extra)),
    ):
        names = [form.axis.name for form in layout.axes if form.axis in concerned] or [""]
        yield from (about(file, kind, name, whose=whose, frames=words) for name in names if whose)


def _matched(
    layout: Layout, motors: Sequence[str], table: Mapping[int, str]
) -> tuple[dict[str, tuple[int, float]], set[int]] | None:
    """Return the servos of a frame by input, and those for which another thruster would do as well.

    Each motor gets one thruster, so that most torques agree with the table of the frame. Among equal ones, a thruster
    whose name is the number of the motor is preferred. The order of the thrusters in the file does not count. It does
    not count either which thruster belongs to which of several motors that always get the same command. The result is
    None if a motor has no thruster.
    """
    from scipy.optimize import linear_sum_assignment  # imported here because it is slow

    thrusters = sorted(layout.thrusters, key=lambda t: t.name)
    if layout.mix or len(motors) > len(thrusters):
        return None
    signs, values = (np.full((len(motors), len(thrusters)), start) for start in (0.0, _IMPOSSIBLE))
    for n, motor in enumerate(motors):
        for k, thruster in enumerate(thrusters):
            agreement, signs[n, k] = _agreement(thruster, motor)
            if signs[n, k]:
                is_written = table.get(n + 1, "").removeprefix("-") == thruster.name
                is_named = thruster.name == str(n + 1)
                values[n, k] = _WRITTEN * is_written + _AGREES * agreement + _NAMED * is_named

    def best(values: Array) -> tuple[Array, float]:
        rows, columns = linear_sum_assignment(values, maximize=True)
        return columns, float(values[rows, columns].sum())

    columns, total = best(values)
    if total < 0.0:
        return None
    open_servos = set()
    for n, motor in enumerate(motors):
        others = values.copy()
        others[[other == motor for other in motors], columns[n]] = _IMPOSSIBLE
        if best(others)[1] == total:
            open_servos.add(n + 1)
    return {f"u_{thrusters[k].name}": (n + 1, signs[n, k]) for n, k in enumerate(columns)}, open_servos


def _agreement(thruster: Thruster, motor: str) -> tuple[int, float]:
    """Return how many torques of a thruster agree with a motor's factors, and 1, or -1 if it pushes the other way.

    Its force must have the signs of the motor's factors, and its torque must not have the opposite sign; otherwise both
    numbers are 0. ArduSub leaves some torques out of its factors.
    """
    effects = [thruster.effect(axis) * (-1.0 if axis is HEAVE else 1.0) for axis in DEMANDS]
    for sign in (1.0, -1.0):
        seen = "".join("." if abs(e) <= FAINT else "+" if sign * e > 0.0 else "-" for e in effects)
        torques = [*zip(seen[:_TORQUES], motor, strict=False)]
        if seen[_TORQUES:] == motor[_TORQUES:] and not {("+", "-"), ("-", "+")} & {*torques}:
            return sum(own == factor for own, factor in torques), sign
    return 0, 0.0
