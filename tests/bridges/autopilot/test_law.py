"""The law in C, against the hold of ArduSub that was written from its sources, and against what it promises."""

import ctypes
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from rov_fmu.bridges.ardusub.law import RATE, Mixer, loops_of
from rov_fmu.bridges.autopilot import flights, law
from rov_fmu.bridges.autopilot.flights import Flights
from rov_fmu.bridges.autopilot.law import AXES, LOOP, PLACE, SHARING, STICK, THRUSTER
from rov_fmu.equation.catalogue import PITCH, ROLL
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.references.autopilot.ardusub import STICK as STICK_TIME
from verification.references.autopilot.ardusub import VECTORED, VECTORED_6DOF, Hold, Motion

SIX, HEAVY = (load_vehicle(SHIPPED[name]) for name in ("bluerov2", "bluerov2_heavy"))


def test_python_and_c_have_the_same_structs() -> None:
    sizes = (ctypes.c_ssize_t * 6)()
    law.load_law().autopilot_sizes(sizes)
    own = [kind.itemsize // 8 for kind in (LOOP, THRUSTER, SHARING)]
    assert [*sizes] == [*own, law.STATE, law.SENSED, ctypes.sizeof(flights._Flight) // 8]


GAINS = {"ATC_RAT_YAW_P": 0.6, "ATC_RAT_YAW_D": 0.01, "PSC_ACCZ_P": 1.2, "PSC_ACCZ_FF": 0.3, "PSC_POSZ_P": 2.0}


@pytest.mark.parametrize(("vehicle", "frame"), [(SIX, VECTORED), (HEAVY, VECTORED_6DOF)])
@pytest.mark.parametrize("gains", [{}, GAINS])
def test_the_law_in_c_is_ardusubs_hold(
    vehicle: Vehicle, frame: tuple[tuple[int, ...], ...], gains: dict[str, float]
) -> None:
    """What the law saw in a flight of 4 s gives the same outputs to the hold of ArduSub, within rounding.

    The hold does not limit the acceleration of roll and pitch.
    """
    share = replace(Mixer(vehicle).sharing, steps=0.0, scales=True)
    modes = np.tile([STICK, STICK, PLACE, PLACE, PLACE, PLACE], (1600, 1))
    both = [[0.0, 0.0, 10.0, 0.0, 0.0, 0.0], [0.5, -0.5, 10.5, 0.0, 0.0, radians(90.0)]]
    aims = np.repeat(both, [100, 1500], axis=0)
    loops = loops_of(gains, 1)
    loops["brake"][:, [AXES.index(ROLL), AXES.index(PITCH)]] = 0.0
    flown = Flights(vehicle, share, [{"z": 10.0}]).fly(loops, modes, aims, 1.0 / RATE)
    hold, sticks, sinking = Hold.by(gains, frame=frame), np.zeros(2), 0.0
    for seen, aim, outputs in zip(flown.sensors[0], aims, flown.outputs[0], strict=True):
        hold.depth, hold.heading = aim[2], aim[5]
        sticks += (aim[:2] - sticks) / (1.0 + RATE * STICK_TIME)
        attitude, rates, sinks = (*seen[3:6],), (*seen[9:12],), seen[14]
        motion = Motion(attitude, rates, seen[2], sinks, RATE * (sinks - sinking))
        sinking = sinks
        assert outputs == pytest.approx(hold.outputs(motion, sticks[0], sticks[1], 1.0 / RATE), abs=1e-12)
    assert abs(flown.outputs).max() == 1.0
