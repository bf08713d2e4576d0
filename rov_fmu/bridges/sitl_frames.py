"""The frames of ArduSub, and which servo drives which input of a vehicle."""

from collections.abc import Mapping, Sequence

from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.equation.layout import FAINT, Layout, Thruster
from rov_fmu.io.messages import InputError, only

_AXES = (ROLL, PITCH, YAW, HEAVE, SURGE, SWAY)
_LINEAR = (HEAVE, SURGE, SWAY)
_SIMPLE = ("..-.+.", "..+.+.", "...-..", "...-..", ".....+")
FRAMES: Mapping[str, Sequence[str]] = {
    "vectored": ("..+.-+", "..-.--", "..-.++", "..+.+-", "+..-..", "-..-.."),
    "vectored_6dof": ("..+.-+", "..-.--", "..-.++", "..+.+-", "+-.-..", "--.-..", "++.-..", "-+.-.."),
    "vectored_6dof_90deg": ("++.+..", "..+.+.", "+-.+..", ".....+", ".....+", "-+.+..", "..-.+.", "--.+.."),
    "bluerov1": ("..-.+.", "..+.+.", "-+.+..", "++.+..", ".-.+..", "-....+"),
    "simplerov_3": _SIMPLE[:3],
    "simplerov_4": _SIMPLE[:4],
    "simplerov_5": _SIMPLE,
}
"""The signs of the factors of each motor for roll, pitch, yaw, throttle (up), forward and lateral (to starboard).

They are those of `AP_Motors6DOF::setup_motors` in ArduPilot. ArduSub sets up the same five motors for every simple
frame; a vehicle has the first three, four or five of them."""

Servos = Mapping[str, tuple[int, float]]
"""For each input of the vehicle that a servo drives, the number of the servo from 1 on, and 1, or -1 if reversed."""


def servos_of(layout: Layout, frame: str | None, table: Mapping[int, str]) -> Servos:
    """Return the servos that drive the inputs of a vehicle.

    `frame` is the name of one of ArduSub's frames, whose motor n is servo n. The default is the first frame that fits:
    each of its motors drives one thruster, and each thruster is driven. `table` maps servos to thrusters, fins or other
    inputs by name, instead of the frame or in addition to it; a minus before a name reverses it. Raises InputError.
    """
    servos: dict[str, tuple[int, float]] = {}
    if frame is not None:
        motors = _matched(layout, FRAMES[frame])
        if motors is None:
            raise InputError(f"--frame {frame}: the motors of this frame do not push as the thrusters do{_ADVICE}")
        servos = {**motors}
    elif not table:
        frames = (_matched(layout, motors) for motors in FRAMES.values() if len(motors) == len(layout.thrusters))
        if (first := next(filter(None, frames), None)) is None or len(first) < len(layout.commands):
            raise InputError(f"VEHICLE: none of ArduSub's frames has these thrusters{_ADVICE}")
        servos = first
    for servo, name in table.items():
        key = f"u_{name.removeprefix('-')}"
        if key not in layout.commands:
            names = [command.removeprefix("u_") for command in layout.commands]
            raise InputError(f"--servo {servo}={name}: there is no such input{only(name.removeprefix('-'), names)}")
        if any(key == f"u_{other.removeprefix('-')}" for number, other in table.items() if number < servo):
            raise InputError(f"--servo {servo}={name}: another servo drives this input")
        servos = {other: motor for other, motor in servos.items() if motor[0] != servo}
        servos[key] = servo, -1.0 if name.startswith("-") else 1.0
    return servos


_ADVICE = ": write --servo NUMBER=THRUSTER for each servo"


def _matched(layout: Layout, motors: Sequence[str]) -> dict[str, tuple[int, float]] | None:
    """Return the servos of a frame by input, or None if a motor has no thruster."""
    if layout.mix:
        return None
    free = [*layout.thrusters]
    servos = {}
    for servo, motor in enumerate(motors, 1):
        fitting = [(t, sign) for sign in (1.0, -1.0) for t in free if _pushes(t, sign, motor)]
        named = [(t, sign) for t, sign in fitting if t.name == str(servo)]
        if not fitting:
            return None
        thruster, sign = (named or fitting)[0]
        free.remove(thruster)
        servos[f"u_{thruster.name}"] = servo, sign
    return servos


def _pushes(thruster: Thruster, sign: float, motor: str) -> bool:
    """Return True if a thruster pushes as a motor does.

    Its force must have the signs of the motor's factors. Its torque must not have the opposite sign; other torques do
    not count, because ArduSub leaves them out of its factors.
    """
    for axis, factor in zip(_AXES, motor, strict=True):
        effect = sign * thruster.effect(axis) * (-1.0 if axis is HEAVE else 1.0)
        seen = "." if abs(effect) <= FAINT else "+" if effect > 0.0 else "-"
        if seen != factor and (axis in _LINEAR or "." not in (seen, factor)):
            return False
    return True
