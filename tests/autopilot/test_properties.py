"""The law in C, against the hold of ArduSub that was written from its sources, and against what it promises."""

import ctypes
from dataclasses import replace
from itertools import product
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import rov_fmu
from rov_fmu.autopilot import flights, law
from rov_fmu.autopilot.allocation import thrust_rows, voltages
from rov_fmu.autopilot.ardusub import RATE, Mixer, loops_of
from rov_fmu.autopilot.flights import Flights
from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.autopilot.law import AXES, LOOP, PLACE, SENSORS, SHARING, STICK, THRUSTER
from rov_fmu.autopilot.law import GAINS as NUMBERS
from rov_fmu.autopilot.law import RATE as SPEED
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import THRUST_EFFECTS
from verification.references.autopilot.ardusub import STICK as STICK_TIME
from verification.references.autopilot.ardusub import VECTORED, VECTORED_6DOF, Hold, Motion
from verification.references.autopilot.cascade import Cascade

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

    The hold does not limit the acceleration of roll and pitch. The target of the heading moves by the hold.
    """
    shaping = Hold.by(gains, heading=0.0)
    shaping._heading(1.0 / RATE)
    shaping.heading = radians(90.0)
    share = replace(Mixer(vehicle).sharing, steps=0.0, scales=True)
    modes = np.tile([STICK, STICK, PLACE, PLACE, PLACE, PLACE], (1600, 1))
    both = [[0.0, 0.0, 10.0, 0.0, 0.0, 0.0], [0.5, -0.5, 10.5, 0.0, 0.0, radians(90.0)]]
    aims = np.repeat(both, [100, 1500], axis=0)
    aims[100:, 5] = [shaping._heading(1.0 / RATE)[0] for _ in range(1500)]
    loops = loops_of(gains, 1)
    loops["k_aim"][:, AXES.index(YAW)] = 1.0
    loops["brake"][:, [AXES.index(ROLL), AXES.index(PITCH)]] = 0.0
    flown = Flights(vehicle, share, [{"z": 10.0}]).fly(loops, modes, aims, 1.0 / RATE)
    hold, sticks, sinking = Hold.by(gains, frame=frame), np.zeros(2), 0.0
    for seen, aim, outputs in zip(flown.sensors[0], aims, flown.outputs[0], strict=True):
        hold.depth, hold.heading = aim[2], radians(90.0) * (aim[0] != 0.0)
        sticks += (aim[:2] - sticks) / (1.0 + RATE * STICK_TIME)
        attitude, rates, sinks = (*seen[3:6],), (*seen[9:12],), seen[14]
        motion = Motion(attitude, rates, seen[2], sinks, RATE * (sinks - sinking))
        sinking = sinks
        assert outputs == pytest.approx(hold.outputs(motion, sticks[0], sticks[1], 1.0 / RATE), abs=1e-12)
    assert abs(flown.outputs).max() == 1.0


@pytest.mark.parametrize("name", ["videoray", "bluerov2"])
def test_the_law_in_c_is_the_cascade_from_the_stick_to_a_hold_and_to_another(name: str) -> None:
    """What the law saw gives the same demands to the cascade, within rounding. No thruster reaches its limit."""
    made = autopilot_of(load_vehicle(SHIPPED[name]))
    axes = {SURGE: ("u", "x", False), HEAVE: ("vg_D", "z", False), YAW: ("r", "psi", True)}
    share = {name: SENSORS.index(name) for names in axes.values() for name in names[:2]}
    parts = [(STICK, 0.05, 0.1, 0.02), (PLACE, 0.1, 10.3, 0.1), (STICK, 0.0, 0.0, 0.0), (PLACE, 0.1, 10.4, -0.2)]
    modes, aims = np.zeros((400, 6)), np.zeros((400, 6))
    for n, (mode, ahead, depth, heading) in enumerate(parts):
        rows, places = slice(100 * n, 100 * n + 100), [AXES.index(axis) for axis in axes]
        modes[rows, places] = SPEED if mode == PLACE else STICK, mode, mode
        aims[rows, places] = ahead, depth, heading
    seen = Flights(made.vehicle, made.sharing, [{"z": 10.0}]).fly(made.loops, modes, aims, made.step)
    assert np.abs(seen.outputs).max() < 1.0
    for axis, (rate, place, turns) in axes.items():
        a = AXES.index(axis)
        loop = Cascade({key: made.gain(axis, key) for key in NUMBERS}, turns)
        for now, mode, aim, demand in zip(seen.sensors[0], modes[:, a], aims[:, a], seen.demands[0, :, a], strict=True):
            given = now[share[place]], now[share[rate]]
            expected = (
                loop.stick(aim)
                if mode == STICK
                else loop.place(aim, *given, made.step)
                if mode == PLACE
                else loop.rate(aim, given[1], made.step)
            )
            assert demand == pytest.approx(expected, abs=1e-9)


# ---- The numbers -----------------------------------------------------------------------------------------------------


def test_the_feed_forward_is_the_drag_and_the_inertia_of_the_vehicle_file() -> None:
    made = autopilot_of(SIX)
    for axis, v in ((SURGE, "u"), (HEAVE, "w")):
        inertia = (SIX["m_rov"] + SIX[f"m_a_{v}"]) / SIX[f"beta_{v}"]
        found = [made.gain(axis, name) for name in ("d_1", "d_2", "inertia")]
        assert found == pytest.approx([SIX[f"b_d_{v}"], SIX[f"a_d_{v}"], inertia])


def test_a_curve_is_known_at_all_voltages_of_its_tables_or_around_that_of_the_battery() -> None:
    rov = load_vehicle(THRUST_EFFECTS)
    main, *others = (voltages(rov, curve) for curve in rov.layout.curves)
    assert (main[0], main[-1]) == (12.0, 16.0)
    for found in others:
        around = np.array([found[0], rov.layout.voltage, found[-1]], float)
        assert (np.diff(around) > 0.0).all()


def test_each_of_several_vehicles_flies_by_its_own_gains() -> None:
    made = autopilot_of(SIX)
    soft = made.loops.copy()
    soft["k_x"] *= 0.3
    modes, aims = (np.tile(row, (100, 1)) for row in ([STICK, STICK, PLACE, STICK, STICK, PLACE], [0, 0, 11, 0, 0, 1]))
    both = Flights(SIX, made.sharing, [{"z": 10.0}] * 2).fly(np.stack([made.loops, soft]), modes, aims, made.step)
    for loops, seen in zip((made.loops, soft), both.sensors, strict=True):
        alone = Flights(SIX, made.sharing, [{"z": 10.0}]).fly(loops, modes, aims, made.step).sensors[0]
        assert seen == pytest.approx(alone, abs=1e-12)
    assert np.abs(both.sensors[0] - both.sensors[1]).max() > 0.1


@pytest.mark.parametrize(
    "pair", [(SURGE, SWAY), (HEAVE, ROLL), (HEAVE, PITCH)], ids=["level", "with roll", "with pitch"]
)
def test_axes_that_ask_for_too_much_together_are_scaled_and_keep_their_direction(pair: tuple[Axis, Axis]) -> None:
    made = autopilot_of(HEAVY)
    aims = np.zeros((2, 6))
    aims[:, [AXES.index(axis) for axis in pair]] = 1.0, 0.5
    flight = Flights(HEAVY, made.sharing, [{"z": 10.0}]).fly(made.loops, np.full((2, 6), STICK), aims, made.step)
    commands = dict(zip(HEAVY.layout.commands, flight.outputs[0, -1].tolist(), strict=True))
    forces = HEAVY.commanded(HEAVY.layout.usual_inputs | commands)
    X, Y = (sum(t.effect(axis) * forces[t.name] for t in HEAVY.layout.thrusters) for axis in pair)
    asked = flight.demands[0, -1, [AXES.index(axis) for axis in pair]]
    assert pytest.approx(asked[1] / asked[0], rel=1e-3) == Y / X
    assert 0.0 < X < 0.99 * asked[0]


@pytest.mark.parametrize("path", [SHIPPED["videoray"], SHIPPED["bluerov2"], THRUST_EFFECTS], ids=lambda path: path.stem)
def test_the_force_between_two_rows_is_that_of_the_curve(path: Path) -> None:
    """To 4e-4 of the force, or of 1/200 of the strongest one, beyond the dead band."""
    rov = load_vehicle(path)
    for curve, sign in product(rov.layout.curves, (1.0, -1.0)):
        rows = sign * np.array(thrust_rows(rov, curve, rov.layout.voltage))
        force, command = rows[rows[:, 0] > 0.0][:: int(sign)].T
        commands = np.linspace(command[0], command[-1], 4001)
        true = np.array([sign * rov.curve_force(curve, sign * c, rov.layout.voltage) for c in commands.tolist()])
        off = np.abs(np.interp(commands, command, force) - true)
        assert (off < 4e-4 * np.maximum(true, 0.005 * true.max())).all()


def test_thrusters_get_whole_steps_of_their_pulses() -> None:
    """ArduSub sends whole microseconds, and drops what is left of one."""
    share = Mixer(SIX).sharing
    modes, aims = np.full((1, 6), STICK), np.array([[0.31, -0.17, 0.23, 0.0, 0.0, 0.05]])
    whole, fine = (
        Flights(SIX, one, [{"z": 10.0}]).fly(loops_of({}, 1), modes, aims, 1.0 / RATE).outputs[0]
        for one in (share, replace(share, steps=0.0))
    )
    assert np.abs(fine).max() > 0.0
    assert whole == pytest.approx(np.floor(share.steps * fine) / share.steps, abs=1e-12)


# ---- What it promises ------------------------------------------------------------------------------------------------


def test_a_hold_begins_without_a_jump() -> None:
    """The demand goes on from that of the stick, though the vehicle is fast and the aim is 3 m away."""
    made = autopilot_of(HEAVY)
    flights, h = Flights(HEAVY, made.sharing, [{"z": 10.0}]), made.step
    stick = np.tile([0.0, 0.0, 0.4, 0.0, 0.0, 0.3], (100, 1))
    modes = np.tile([STICK, STICK, STICK, PLACE, PLACE, STICK], (100, 1))
    before = flights.fly(made.loops, modes, stick, h)
    modes[:, [2, 5]], stick[:, [2, 5]] = PLACE, (13.0, 1.0)
    after = flights.fly(made.loops, modes, stick, h)
    assert np.abs(after.demands[0, 0] - before.demands[0, -1])[[2, 5]] == pytest.approx([0.0, 0.0], abs=1e-9)
    most = made.loops["most"][[2, 5]]
    assert (np.abs(np.diff(after.demands[0], axis=0))[:, [2, 5]] < 0.2 * most).all()


def test_a_hold_in_a_current_begins_with_its_velocity_over_ground() -> None:
    """Otherwise the current would come as a jump of the velocity, and of the force, in the second step."""
    made, still = autopilot_of(HEAVY), {"V_N": 0.5}
    rov = rov_fmu.load("bluerov2_heavy")
    assert rov.stepper(inputs=still).now["vg_N"] == 0.5
    flown = Flights(HEAVY, made.sharing, [{"z": 10.0}]).fly(
        made.loops, np.full((3, 6), PLACE), np.tile([0.0, 0.0, 10.0, 0.0, 0.0, 0.0], (3, 1)), made.step, still
    )
    assert flown.sensors[0, 0, SENSORS.index("vg_N")] == 0.5
    force = rov.hold(0.2, still, start={"z": 10.0}, north=0.0, east=0.0, depth=10.0, heading=0.0)["F_1"]
    assert np.ptp(force) > 6.0
    assert np.abs(np.diff(force)[:2]).max() < 3.0, "it was 7.3 N"


@pytest.mark.parametrize("name", ["videoray", "bluerov2", "bluerov2_heavy"])
def test_a_hold_that_begins_in_motion_does_not_overshoot_nor_does_a_speed_from_rest(name: str) -> None:
    """After 3 s of a stick down and to starboard, the depth is held 2 m below and the heading 2 rad on."""
    made = autopilot_of(load_vehicle(SHIPPED[name]))
    flights = Flights(made.vehicle, made.sharing, [{"z": 10.0}])
    level = [PLACE if axis in (ROLL, PITCH) and axis in made.axes else STICK for axis in AXES]
    places = [AXES.index(axis) for axis in (HEAVE, YAW)]
    modes, aims = np.tile(level, (150, 1)), np.zeros((150, 6))
    aims[:, places] = 0.4, 0.3
    before = flights.fly(made.loops, modes, aims, made.step).sensors[0, -1, [2, 5]]
    modes, aims = np.tile(level, (750, 1)), np.zeros((750, 6))
    modes[:, places], aims[:, places] = PLACE, before + 2.0
    after = flights.fly(made.loops, modes, aims, made.step).sensors[0][:, [2, 5]] - before - 2.0
    after[:, 1] = (after[:, 1] + np.pi) % (2.0 * np.pi) - np.pi
    assert (after.max(axis=0) < [0.01, radians(1.0)]).all()
    assert np.abs(after[-1]).max() < 0.005
    modes, aims = np.tile([SPEED, *level[1:]], (500, 1)), np.tile([0.3, *[0.0] * 5], (500, 1))
    fast = Flights(made.vehicle, made.sharing, [{"z": 10.0}]).fly(made.loops, modes, aims, made.step).sensors[0, :, 6]
    assert 0.297 < fast[-1] < fast.max() < 0.3 * 1.07


@pytest.mark.parametrize("angle", [0.7, 2.5, -1.6])
def test_a_hold_does_not_depend_on_where_north_is(angle: float) -> None:
    """The aim, the heading and the current are turned together."""
    made = autopilot_of(HEAVY)

    def demands(angle: float) -> NDArray[np.float64]:
        turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
        current, aim = turn @ [0.2, -0.1], turn @ [1.5, -0.8]
        start = {"z": 10.0, "u": 0.3, "v": -0.2, "V_N": current[0], "V_E": current[1]}
        start |= {"eta": cos(0.5 * (0.4 + angle)), "epsilon_3": sin(0.5 * (0.4 + angle))}
        aims = np.tile([*aim, 10.0, 0.0, 0.0, 0.6 + angle], (100, 1))
        flight = Flights(HEAVY, made.sharing, [start]).fly(made.loops, np.full((100, 6), PLACE), aims, made.step)
        return np.asarray(flight.demands[0])

    assert demands(angle) == pytest.approx(demands(0.0), abs=1e-6)


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 1.3), (0.0, -1.3), (2.0, 0.4)])
def test_the_attitude_is_held_where_pitch_is_large(roll: float, pitch: float) -> None:
    """The pitch of 75 degrees is reached, with the depth and a heading beside it, which Euler angles alone lose."""
    made = autopilot_of(HEAVY.with_(W=112.8, B=112.8))
    aims = np.tile([0.0, 0.0, 10.0, roll, pitch, 2.0], (1500, 1))
    modes = np.tile([STICK, STICK, PLACE, PLACE, PLACE, PLACE], (1500, 1))
    seen = Flights(made.vehicle, made.sharing, [{"z": 10.0}]).fly(made.loops, modes, aims, made.step).sensors[0]
    assert seen[-1, 3:6] == pytest.approx([roll, pitch, 2.0], abs=0.02)
    assert seen[-1, 2] == pytest.approx(10.0, abs=0.02)


def test_what_the_thrusters_cannot_give_is_taken_back() -> None:
    """A load beyond the strongest thrust for 20 s leaves no more than 10 cm of overshoot after it."""
    made = autopilot_of(SIX)
    flights, steps = Flights(SIX, made.sharing, [{"z": 10.0}]), round(20.0 / made.step)
    modes = np.tile([STICK, STICK, PLACE, STICK, STICK, PLACE], (steps, 1))
    aims = np.tile([0.0, 0.0, 10.0, 0.0, 0.0, 0.0], (steps, 1))
    pushed = flights.fly(made.loops, modes, aims, made.step, {"Z_ext": 1.2 * made.gain(HEAVE, "most")})
    assert pushed.sensors[0, -1, 2] > 11.0
    freed = flights.fly(made.loops, modes, aims, made.step, {"Z_ext": 0.0}).sensors[0, :, 2]
    assert freed.min() > 9.9
    assert freed[-1] == pytest.approx(10.0, abs=0.01)
