"""What rests against something is left out before a fit, and nothing of a dive in which nothing does.

The dives are drawn here by an equation of their own: thrust c|c|, drag, a load, and a floor, a wall, a deck or a hand.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.folder import read_folder
from rov_fmu.tank.log import Commands, Log
from rov_fmu.tank.quality import uninterrupted
from rov_fmu.tank.rest import without_rests
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.recordings import write_dives
from tests.tank.logs import channel, commands, log, used

LAYOUT = load_vehicle(SHIPPED["bluerov2"]).layout
STEP = 0.02


@dataclass
class State:
    """The depth (m), its rate (m/s), the speed ahead (m/s), and the commands down and ahead."""

    z: float
    w: float = 0.0
    u: float = 0.0
    down: float = 0.0
    ahead: float = 0.0


Change = Callable[[float, State], None]


def nothing(t: float, s: State) -> None:
    """Change nothing at a time, s."""


def drawn(
    seed: int,
    command: Change = nothing,
    limit: Change = nothing,
    *,
    start: float = 3.0,
    load: float = -2.0,
    zeroed: float | None = None,
    astern: float = 1.0,
) -> Log:
    """Return a log of 110 s at 10 Hz; `command` may replace what is commanded and `limit` the motion.

    `astern` is how much of the thrust down a push up has.
    `zeroed` is the depth at which a sensor was switched on that takes all above for the surface.
    """
    random = np.random.default_rng(seed)
    starts = np.cumsum(random.uniform(2.5, 5.0, 60))
    plans = random.choice([-0.4, -0.3, -0.2, 0.0, 0.2, 0.3, 0.4], (60, 2))
    s, zero, rows = State(start), zeroed or 0.0, list[tuple[float, ...]]()
    for n in range(int(110.0 / STEP)):
        t = n * STEP
        if n % 5 == 0:
            s.down, s.ahead = plans[int(np.searchsorted(starts, t))].tolist()
            s.down = -0.35 if s.z > 9.0 and s.down > -0.1 else 0.4 if s.z < 1.5 and s.down < 0.2 else s.down
            command(t, s)
            depth = s.z + random.normal(0.0, 0.005)
            zero = zero if zeroed is None else min(zero, depth)
            rows.append((t, s.down, s.ahead, depth - zero, s.u + random.normal(0.0, 0.01)))
        share = float(np.clip(1.0 + s.z / 0.25, 0.0, 1.0))  # of the vehicle in the water
        push = 110.0 * (astern if s.down < 0.0 else 1.0) * s.down * abs(s.down)
        force = push + load - 40.0 * s.w * abs(s.w) - 6.0 * s.w
        s.w += STEP * (share * force + (1.0 - share) * 100.0) / 20.0
        s.u += STEP * (90.0 * s.ahead * abs(s.ahead) - 30.0 * s.u * abs(s.u) - 5.0 * s.u) / 18.0
        s.w *= 1.0 - 2.0 * STEP * (s.z < 0.1)
        limit(t, s)
        s.z += STEP * s.w
    time, down, ahead, depth, speed = np.array(rows).T
    values = {name: np.zeros(len(time)) for name in LAYOUT.commands}
    for axis, pushes in ((HEAVE, down), (SURGE, ahead)):
        for name, sign in LAYOUT.commands_along(axis, 1.0).items():
            values[name] += sign * pushes
    thrusters = {name.removeprefix("u_"): own for name, own in values.items()}
    return log(commands(time, thrusters), channel("depth", time, depth), channel("surge velocity", time, speed))


def left_out(dive: Log, pieces: list[Log]) -> tuple[Array, Flags]:
    """Return the times of the depth, and which of them no piece has."""
    time = used(dive, "depth").time
    return time, ~np.isin(time, np.concatenate([used(piece, "depth").time for piece in pieces]))


def floats(t: float, s: State) -> None:
    s.down = 0.0 if t < 9.0 or t > 97.0 else 0.45 if t < 15.0 else -0.5 if t > 83.0 else s.down


def dives_to(bottom: float) -> Change:
    def limit(_: float, s: State) -> None:
        if s.z >= bottom:
            s.w = min(s.w, (bottom - s.z) / STEP)

    return limit


def pushes_down(t: float, s: State) -> None:
    s.down = 0.35 if 40.0 < t < 62.0 else -0.45 if 62.0 <= t < 66.0 else s.down


def waits(t: float, s: State) -> None:
    s.down = 0.3 * np.sign(np.sin(1.5 * t)) * (t < 8.0) if t < 24.0 else 0.4 if t < 28.0 else s.down


def on_deck(t: float, s: State) -> None:
    s.w = 0.0 if t < 14.0 else 0.5 if t < 22.0 else s.w


def holds_depth(t: float, s: State) -> None:
    """A controller whose goal is below the floor from 45 to 75 s."""
    goal = 7.5 if 45.0 < t < 75.0 else 4.0 + 2.0 * np.sin(t / 6.0)
    noise = 0.02 * np.sin(1e4 * t)
    s.down = float(np.clip(1.2 * (goal - s.z) - 0.9 * s.w + noise, -0.8, 0.8))


def hand(rate: float) -> Change:
    def limit(t: float, s: State) -> None:
        s.w = rate if 46.0 < t < 56.0 and s.z > 1.0 else s.w

    return limit


def wall(t: float, s: State) -> None:
    s.u = min(s.u, 0.0) if 44.0 < t < 54.0 else s.u


def drives_on(t: float, s: State) -> None:
    s.ahead = 0.35 if 20.0 < t < 26.0 or 40.0 < t < 52.0 or 64.0 < t < 70.0 else -0.3 if 52.0 <= t < 56.0 else s.ahead


def rises_beyond(t: float, s: State) -> None:
    """To above the depth of 4 m at which it began."""
    s.down = 0.35 if t < 6.0 or 18.0 < t < 26.0 else -0.3 if t < 18.0 else s.down


def off_at_the_ends(t: float, s: State) -> None:
    """Thrusters that are off until 8 s and from 95 s on leave a neutral vehicle where it is."""
    s.w *= float(8.0 < t < 95.0)


def ends_below(t: float, s: State) -> None:
    s.down = 0.35 if t > 88.0 else s.down


def stuck_below(t: float, s: State) -> None:
    """Thrusters that are off in the mud of the bottom, which holds a vehicle that floats."""
    s.down = 0.5 if 50.0 < t < 60.0 else 0.0 if 60.0 <= t < 80.0 else -0.4 if 80.0 <= t < 84.0 else s.down
    s.w = 0.0 if 60.0 <= t < 80.0 else s.w


def brought_below(t: float, s: State) -> None:
    """Thrusters that are off from 60 to 80 s, while a hand takes a vehicle that floats to the bottom."""
    s.down = 0.0 if 60.0 <= t < 80.0 else -0.4 if 80.0 <= t < 84.0 else s.down
    s.w = 0.5 if 60.0 <= t < 80.0 else s.w


def drifts_above(t: float, s: State) -> None:
    """Thrusters that are off at the surface, to which the load has lifted the vehicle."""
    s.down = 0.0 if t < 20.0 else 0.5 if t < 26.0 else s.down


def held_by_its_tether(t: float, s: State) -> None:
    s.w = 0.0 if 50.0 < t < 66.0 else s.w


def off_for_a_while(t: float, s: State) -> None:
    s.down = 0.0 if 50.0 < t < 66.0 else 0.4 if 66.0 <= t < 72.0 else s.down


def pushes_on(t: float, s: State) -> None:
    s.down = 0.3 if 20.0 < t < 26.0 or 40.0 < t < 56.0 or 64.0 < t < 74.0 else s.down


@pytest.mark.parametrize(
    ("dive", "within", "at_least"),
    [
        (drawn(1, floats, start=0.05), [(0.0, 12.0), (82.0, 110.0)], [(0.0, 9.0), (97.0, 110.0)]),
        (drawn(2, floats, start=0.6, zeroed=0.0), [(0.0, 12.0), (82.0, 110.0)], [(3.0, 8.0), (97.0, 110.0)]),
        (drawn(3, pushes_down, dives_to(7.0)), [(0.0, 110.0)], [(54.0, 61.0)]),
        (drawn(4, ends_below, dives_to(7.0)), [(0.0, 110.0)], [(102.0, 109.0)]),
        (drawn(4, holds_depth, dives_to(6.5)), [(44.0, 78.0)], [(50.0, 74.0)]),
        (drawn(5, waits, on_deck, start=-1.2), [(0.0, 24.5)], [(0.0, 23.5)]),
        (drawn(7, pushes_on, hand(0.0)), [(40.0, 60.0)], [(48.0, 55.0)]),
        (drawn(8, pushes_on, hand(-0.4)), [(40.0, 62.0)], [(50.0, 54.0)]),
        (drawn(9, drives_on, wall), [(42.0, 56.0)], [(45.0, 51.0)]),
        (drawn(12, drifts_above, start=0.05, load=-0.7), [(0.0, 22.0)], [(1.0, 19.5)]),
        (drawn(11, stuck_below, dives_to(7.0), load=-0.5), [(0.0, 110.0)], [(63.0, 79.0)]),
        (drawn(12, drifts_above, start=0.05, load=-1.0, astern=0.75), [(0.0, 22.0)], [(1.0, 19.5)]),
        (drawn(14, brought_below, dives_to(9.0)), [(59.0, 84.0)], [(60.0, 79.0)]),
        (drawn(10, rises_beyond, start=4.0, zeroed=4.0), [(0.0, 110.0)], [(14.0, 17.5)]),
    ],
    ids=[
        "surface",
        "depth set to zero",
        "bottom",
        "bottom at the end",
        "depth held on the bottom",
        "deck",
        "hand",
        "pulled up",
        "wall",
        "thrusters off at the surface",
        "thrusters off on the bottom",
        "weaker thrust up",
        "brought to the bottom",
        "depth set to zero again",
    ],
)
def test_a_rest_is_left_out_with_one_finding(
    dive: Log, within: list[tuple[float, float]], at_least: list[tuple[float, float]]
) -> None:
    """All of the rest is left out, and nothing of the dive that is far from it."""
    pieces = without_rests(dive, LAYOUT)
    time, left = left_out(dive, pieces)
    assert left[np.any([(start <= time) & (time <= end) for start, end in at_least], axis=0)].all()
    assert not left[~np.any([(start <= time) & (time <= end) for start, end in within], axis=0)].any()
    assert [one.kind for piece in pieces for one in piece.findings] == ["rests"]


def test_a_vehicle_that_stays_in_mid_water_without_a_push_rests_against_nothing() -> None:
    """Its tether may hold it, or a thermocline, and the log does not tell until when."""
    dive = drawn(13, off_for_a_while, held_by_its_tether, load=-0.5)
    assert without_rests(dive, LAYOUT) == [dive]


@pytest.mark.parametrize("load", [-4.0, -2.0, 0.0, 3.0])
def test_a_dive_that_touches_nothing_is_left_as_it_is(load: float) -> None:
    for seed in range(3):
        for command in (nothing, holds_depth):
            dive = drawn(10 + seed, command, load=load)
            assert without_rests(dive, LAYOUT) == [dive]


def test_thrusters_that_are_off_at_the_ends_of_a_log_are_no_rest() -> None:
    """Rests between, and those that a surface or a bottom explains, are tried above."""
    for seed in range(5):
        dive = drawn(30 + seed, limit=off_at_the_ends, load=0.0)
        assert without_rests(dive, LAYOUT) == [dive]


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.2, 0.1)])
def test_neither_depth_0_in_a_tank_without_a_surface_nor_a_current_is_a_rest(
    current: tuple[float, float], tmp_path: Path
) -> None:
    """A current stops a vehicle by its heading."""
    for seed in range(2):
        folder = write_dives(tmp_path / str(seed), seed, count=2, seconds=20.0, current=current)
        assert not [one for one in read_folder(folder).findings if one.kind == "rests"]


def test_a_log_of_a_single_axis_and_one_that_only_rests_stay_as_they_are() -> None:
    dive = drawn(1, lambda _, s: setattr(s, "down", 0.0), start=0.05)
    assert without_rests(dive, LAYOUT) == [dive]
    of_axis = replace(drawn(3, pushes_down, dives_to(7.0)), axis=HEAVE)
    assert without_rests(of_axis, LAYOUT) == [of_axis]


def test_times_in_a_piece_of_a_log_count_from_where_the_log_begins() -> None:
    """Also where a gap has divided the log before, and where its clock counts from elsewhere."""
    dive = drawn(7, pushes_on, hand(0.0))
    (rest,) = (one.words["rests"] for piece in without_rests(dive, LAYOUT) for one in piece.findings)
    assert dive.commands
    rows = dive.commands.rows
    shown = [
        replace(c, time=c.time + 1e6, values=c.values + np.where((c.time > 5.0) & (c.time < 8.0), np.nan, 0.0))
        for c in dive.channels
    ]
    kept = (rows <= 5.0) | (rows >= 8.0)
    told = Commands.of_rows(
        dive.commands.thrusters, rows[kept] + 1e6, dive.commands.at(rows[kept]), dive.commands.source
    )
    pieces = [
        own
        for piece in uninterrupted(replace(dive, commands=told, channels=tuple(shown)))
        for own in without_rests(piece, LAYOUT)
    ]
    assert [one.words["rests"] for piece in pieces for one in piece.findings if one.kind == "rests"] == [rest]
    assert [piece.file for piece in pieces][:2] == ["a.csv", "a.csv (from 8 s)"]
    assert [piece.begin for piece in pieces] == [1e6] * len(pieces)
    assert [piece.whole_file for piece in pieces] == ["a.csv"] * len(pieces)


def test_a_bottom_on_which_it_has_rested_is_left_out_at_each_short_touch() -> None:
    for seed in range(4):
        pieces = without_rests(drawn(20 + seed, pushes_down, dives_to(7.0)), LAYOUT)
        assert max(used(piece, "depth").values.max() for piece in pieces) < 6.9
