"""Hold a vehicle level as ArduSub does: `python -m examples.hold_level` flies the BlueROV2 Heavy ahead for 20 s.

The law is that of `verification/references/autopilot/ardusub.py`. The page that flies holds the Heavy in the same way.
"""

from collections.abc import Callable
from math import cos, degrees, sin

import rov_fmu
from verification.references.autopilot.ardusub import STICK, VECTORED_6DOF, Hold, Motion

STEP = 0.02
"""The time between two calls of the law in `fly`, s. ArduSub itself runs at 400 Hz."""


def fly(seconds: float, forward: float, hold: Hold | None, print_line: Callable[[str], None] = print) -> float:
    """Fly the Heavy ahead from a depth of 1 m, and return the largest tilt, rad.

    `forward` is the stick at the end of its way. Without a hold, it alone drives the motors.
    """
    heavy = rov_fmu.load("bluerov2_heavy").stepper(start={"z": 1.0})
    now = heavy.now
    sinking = most = stick = 0.0
    for step in range(round(seconds / STEP)):
        phi, theta = now["phi"], now["theta"]
        down = -sin(theta) * now["u"] + cos(theta) * (sin(phi) * now["v"] + cos(phi) * now["w"])
        motion = Motion(
            (phi, theta, now["psi"]), (now["p"], now["q"], now["r"]), now["z"], down, (down - sinking) / STEP
        )
        sinking, most = down, max(most, abs(phi), abs(theta))
        stick += STEP / (STEP + STICK) * (forward - stick)
        outputs = hold.outputs(motion, stick, 0.0, STEP) if hold else [stick * f[4] for f in VECTORED_6DOF]
        commands = {f"u_{n}": output for n, output in enumerate(outputs, 1)}
        now = heavy.step(commands, STEP)
        if (step + 1) % round(5.0 / STEP) == 0:
            print_line(f"{(step + 1) * STEP:4.0f} s: {now['x']:5.1f} m ahead, depth {now['z']:5.2f} m")
    return most


if __name__ == "__main__":
    for words, law in (("held level", Hold()), ("raw thrusters", None)):
        print(f"{words}: the largest tilt is {degrees(fly(20.0, 1.0, law)):.0f} degrees")
