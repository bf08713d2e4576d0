"""What strangers do that the equation of the product does not have, each with a fixed dose. One table, KINDS.

The doses were chosen so that the best fit of the law is mostly more than 5 % from the truth; where it is not, the axis
counts as one that the law fits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from verification.identification.strangers.water import (
    HEAVE,
    ROW,
    SURGE,
    SWAY,
    YAW,
    Act,
    Array,
    Body,
    Moment,
    nothing,
)

Followed = Callable[[Array], Array]
Shown = Callable[[dict[int, Array], np.random.Generator], None]
"""Changes what the sensors show of each axis without noise: velocities in surge and sway, depth, and heading."""
PORT, STBD = 0, 1


def _as_logged(rows: Array) -> Array:
    return rows


def _as_it_is(_columns: dict[int, Array], _random: np.random.Generator) -> None:
    """Show the true motion."""


@dataclass(frozen=True)
class Kind:
    """A kind of vehicle."""

    name: str
    what: str
    """What it does, with the dose."""
    act: Act = nothing
    wired: Followed = _as_logged
    """The commands that reach each thruster, for those of a log: rows x 4 x n."""
    followed: Followed = _as_logged
    """What the thrusters make of the commands that reach them."""
    shown: Shown = _as_it_is
    causes: str = "-"
    """A regular expression of the causes that are true, each as its kind and what has it: `neutral port`."""
    counts: tuple[int, ...] = (2, 4)
    """The numbers of axes of the vehicles that may be of this kind."""
    has_hidden_sway: bool = False
    """True if the vehicle also drifts sideways, with Coriolis and Munk terms, which neither file nor log has."""
    alike: bool = False
    """True if port and starboard always get the same command."""
    has_table: bool = True
    """False if nobody measured the thrust: rov.toml says about how large it is, 5 % too little."""
    size: float = 1.0
    """Its mass relative to that of the others."""
    reach: float = 1.0
    ahead: float = 0.0
    """Those of Body: where the thrusters are beside what rov.toml says."""
    jitter: float = 0.0
    """The standard deviation of the error of each time stamp, s."""
    steps: float = 0.0
    """The smallest difference of the depths in a log, m."""
    is_cut: bool = False
    """True if each log lacks 3 s in its middle, so that it is read in two pieces."""
    group: str = "stranger"
    """`stranger`, `hidden` (no log can show it), or `law` (it obeys the equation)."""


# ---- Water -----------------------------------------------------------------------------------------------------------


def _squares(b: Body, v: Array) -> Array:
    """Return the quadratic drag of each axis relative to |v| v, without its direction."""
    return b.quadratic[:, None] * v


def _power(m: Moment, b: Body) -> None:
    v, top = m.velocity, b.top[:, None]
    m.drag += _squares(b, v) * (np.sqrt(0.6 * top * np.abs(v)) - np.abs(v))


def _cubic(m: Moment, b: Body) -> None:
    v, top = m.velocity, b.top[:, None]
    m.drag += 1.2 * _squares(b, v) * v * v / top


def _turning(m: Moment, b: Body) -> None:
    turn = b.top[SURGE] * np.abs(m.velocity[YAW]) / b.top[YAW]
    for axis in (SURGE, SWAY):
        m.drag[axis] += b.quadratic[axis] * turn * m.velocity[axis]


def _fouled(m: Moment, _: Body) -> None:
    m.drag *= np.where(m.clock > 20.0, 1.5, 1.0)


def _crisis(m: Moment, b: Body) -> None:
    share = np.abs(m.velocity) / b.top[:, None]
    m.drag *= 1.0 - 0.35 / (1.0 + np.exp(-(share - 0.45) / 0.04))


def _two_shapes(m: Moment, b: Body) -> None:
    v, top = m.velocity, b.top[:, None]
    m.drag += np.where(v < 0.0, 0.5 * _squares(b, v) * (0.6 * top - np.abs(v)), 0.0)


def _remembered(m: Moment, b: Body) -> None:
    lag = m.velocity - m.memory
    m.recall += lag / 1.5
    m.push -= 0.25 * b.quadratic[:, None] * b.top[:, None] * lag


def _heavier(m: Moment, b: Body) -> None:
    m.inertia *= 1.0 + 0.6 * (1.0 - np.exp(-((m.velocity / (0.4 * b.top[:, None])) ** 2)))


def _wake(m: Moment, b: Body) -> None:
    m.recall += (m.velocity - m.memory) / 4.0
    m.drag += b.drag(m.velocity - 0.2 * m.memory) - b.drag(m.velocity)


def _away(m: Moment) -> Array:
    return np.asarray(np.hypot(m.place[0], m.place[1]))


def _tether(m: Moment, _: Body) -> None:
    m.drag *= 1.0 + _away(m) / 8.0


def _wall(m: Moment, _: Body) -> None:
    if m.where == "dive":
        m.drag *= 1.0 + 0.8 * np.exp(-_away(m) / 2.0)


# ---- Thrusters -------------------------------------------------------------------------------------------------------


def _jets(m: Moment, _: Body) -> None:
    port, stbd = m.goal[PORT], m.goal[STBD]
    larger = np.maximum(np.maximum(np.abs(port), np.abs(stbd)), 1e-9)
    m.gain[:2] *= 1.0 - np.where(port * stbd > 0.0, 0.25 * np.minimum(np.abs(port), np.abs(stbd)) / larger, 0.0)


def _jet_astern(m: Moment, _: Body) -> None:
    m.gain[STBD] *= np.where(m.goal[PORT] < 0.0, 0.75, 1.0)


def _stiction(rows: Array) -> Array:
    found, turns = np.zeros_like(rows), np.zeros(rows.shape[1:], dtype=bool)
    for row, command in enumerate(rows):
        turns = np.abs(command) > np.where(turns, 0.03, 0.3)
        found[row] = np.where(turns, command, 0.0)
    return found


def _play(rows: Array) -> Array:
    found, now = np.zeros_like(rows), np.zeros(rows.shape[1:])
    for row, command in enumerate(rows):
        now = np.clip(now, command - 0.08, command + 0.08)
        found[row] = now
    return found


def _coanda(m: Moment, b: Body) -> None:
    m.gain[:2] *= 1.0 - 0.35 * np.exp(-((m.velocity[SURGE] / (0.25 * b.top[SURGE])) ** 2))


def _limited(m: Moment, _: Body) -> None:
    power = np.sum(np.abs(m.goal) ** 1.5, axis=0)
    m.goal *= np.minimum(1.0, 0.2 / np.maximum(power, 1e-9)) ** (2.0 / 3.0)


def _ventilated(m: Moment, _: Body) -> None:
    if m.where != "bench":
        m.gain *= 1.0 - 0.3 / (1.0 + np.exp(-(np.abs(m.command) - 0.4) / 0.03))


def _warming(m: Moment, _: Body) -> None:
    if m.where != "bench":
        m.gain *= 1.0 - 0.25 * (1.0 - np.exp(-m.clock / 30.0))


def _uneven_lag(m: Moment, _: Body) -> None:
    m.lag *= np.where(np.abs(m.goal) > 0.0, 2.5, 0.5)


# ---- Sensors ---------------------------------------------------------------------------------------------------------


def _of_velocities(change: Callable[[Array, np.random.Generator], Array]) -> Shown:
    """Return what changes the values of each velocity sensor, rows x n."""

    def shown(columns: dict[int, Array], random: np.random.Generator) -> None:
        for axis in (SURGE, SWAY):
            if axis in columns:
                columns[axis] = change(columns[axis], random)

    return shown


def _stale(values: Array, random: np.random.Generator) -> Array:
    found = values.copy()
    for n in range(values.shape[1]):
        for begin in random.integers(30, len(values) - 40, 4):
            found[begin : begin + 30, n] = found[begin, n]
    return found


def _filtered(values: Array, time_constant: float) -> Array:
    kept = np.exp(-ROW / time_constant)
    return np.asarray(lfilter([1.0 - kept], [1.0, -kept], values, axis=0))


def _wander(values: Array, random: np.random.Generator) -> Array:
    white = random.standard_normal(values.shape) * np.sqrt(2.0 * 8.0 / ROW)
    return values + 0.04 * _filtered(white, 8.0)


def _turned(columns: dict[int, Array], _: np.random.Generator) -> None:
    angle, u, v = np.radians(25.0), columns[SURGE], columns[SWAY]
    columns[SURGE], columns[SWAY] = u * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - u * np.sin(angle)


def _compass(columns: dict[int, Array], _: np.random.Generator) -> None:
    columns[YAW] = columns[YAW] + np.radians(12.0) * np.sin(columns[YAW])


def _unlocked(values: Array, random: np.random.Generator) -> Array:
    found = values.copy()
    for n in range(values.shape[1]):
        for begin in random.integers(30, len(values) - 40, 3):
            found[begin : begin + 30, n] = 0.0
    return found


def _over_ground(columns: dict[int, Array], random: np.random.Generator) -> None:
    psi, u, v = columns[YAW], columns[SURGE].copy(), columns.get(SWAY, 0.0 * columns[SURGE]).copy()
    to = {SURGE: u * np.cos(psi) - v * np.sin(psi), SWAY: u * np.sin(psi) + v * np.cos(psi)}
    for n in range(psi.shape[1]):
        for begin in random.integers(30, len(psi) - 40, 3):
            for axis in (SURGE, SWAY):
                if axis in columns:
                    columns[axis][begin : begin + 30, n] = to[axis][begin : begin + 30, n]


def _unsettled(values: Array, random: np.random.Generator) -> Array:
    found = values.copy()
    for n in range(values.shape[1]):
        end = random.integers(110, 170)
        found[:end, n] += 0.6 * np.arange(end) / end
    return found


def _waved(columns: dict[int, Array], _: np.random.Generator) -> None:
    phase = 2.0 * np.pi * ROW * np.arange(len(columns[YAW]))[:, None] / 6.0
    drift = 0.1 * 2.0 * np.pi / 6.0 * np.cos(phase)
    columns[SURGE] += drift * np.cos(columns[YAW])
    columns[SWAY] -= drift * np.sin(columns[YAW])
    columns[HEAVE] += 0.1 * np.cos(phase)


# ---- What the product knows ------------------------------------------------------------------------------------------


def _weak(m: Moment, _: Body) -> None:
    m.gain[PORT] *= 0.55


def _with_strength(share: float) -> Act:
    """Return what makes port stronger or weaker than starboard, whose thrust is measured."""

    def act(m: Moment, _: Body) -> None:
        m.gain[PORT] *= share

    return act


def _slower(m: Moment, _: Body) -> None:
    m.lag[PORT] *= 1.08


def _fails(m: Moment, _: Body) -> None:
    m.gain[PORT] *= np.where(m.clock > 60.0, 0.4, 1.0)


def _near(m: Moment, b: Body) -> None:
    m.gain[PORT] *= 1.012
    m.lag[PORT] *= 1.04
    m.drag *= np.where(m.velocity < 0.0, 1.02, 1.0)
    m.drag += 0.02 * _squares(b, m.velocity) * m.velocity**2 / b.top[:, None]


def _nearly(columns: dict[int, Array], random: np.random.Generator) -> None:
    columns[YAW] = columns[YAW] + np.radians(0.4) * np.sin(columns[YAW])
    for axis in (SURGE, SWAY):
        if axis in columns:
            swell = 0.006 * np.sin(
                2.0 * np.pi * ROW * np.arange(len(columns[axis]))[:, None] / 6.0 + random.uniform(0.0, 6.0)
            )
            columns[axis] = 1.006 * columns[axis] + swell


def _lost_blade(m: Moment, _: Body) -> None:
    m.gain[PORT] *= np.where(m.goal[PORT] < 0.0, 0.55, 0.85)


def _neutral_off(rows: Array) -> Array:
    found = rows.copy()
    found[:, PORT] += 0.04
    return np.asarray(np.clip(found, -1.0, 1.0))


def _unequal_lags(m: Moment, _: Body) -> None:
    m.lag[PORT] *= 2.5


def _payload(m: Moment, _: Body) -> None:
    m.inertia *= np.where(m.clock > 20.0, 1.3, 1.0)


def _bent(m: Moment, b: Body) -> None:
    c = np.abs(m.command)
    m.goal = b.goal(np.sign(m.command) * (c + 3.0 * c * (c - 0.3) * (c - 0.5) * (c - 1.0)))


def _rotors(m: Moment, b: Body) -> None:
    beyond = np.sqrt(np.abs(m.goal) / b.directed(m.command))
    m.goal = np.sign(m.command) * beyond
    m.share = lambda state: np.asarray(np.abs(state) * state * b.directed(state))
    m.lost *= 0.0


def _reversed(rows: Array) -> Array:
    return np.asarray(rows * np.array([1.0, -1.0, 1.0, 1.0])[:, None])


def _swapped(rows: Array) -> Array:
    return np.asarray(rows[:, [STBD, PORT, 2, 3]])


def _late(rows: Array) -> Array:
    return np.concatenate([0.0 * rows[:2], rows[:-2]])


def _drifting(columns: dict[int, Array], _: np.random.Generator) -> None:
    psi, (north, east) = columns[YAW], (0.06, -0.03)
    columns[SURGE] += north * np.cos(psi) + east * np.sin(psi)
    if SWAY in columns:
        columns[SWAY] += east * np.cos(psi) - north * np.sin(psi)


def _slowly(values: Array, random: np.random.Generator) -> Array:
    return values + 0.02 * _filtered(random.standard_normal(values.shape) * np.sqrt(2.0 / ROW), 1.0)


AS_MODELLED = Kind("as modelled", "nothing else", group="law")
FAULTS = (
    Kind("weak thruster", "port has 55 % of its thrust", _weak, causes=r"weak thruster .*port", group="law"),
    Kind(
        "weak, no table",
        "the same, and nobody measured the thrust",
        _weak,
        causes=r"weak thruster .*port",
        has_table=False,
        group="law",
    ),
    Kind(
        "reversed, no table",
        "starboard is reversed, and nobody measured the thrust",
        wired=_reversed,
        causes=r"(signs|reversed).*stbd.*",
        has_table=False,
        group="law",
    ),
    Kind("bent table", "the thrust deviates from a square by up to 6 % of the command", _bent, group="law"),
    Kind(
        "unsettled velocity",
        "an estimator's velocity drifts by 0.6 m/s until it gets a position",
        shown=_of_velocities(_unsettled),
        group="law",
    ),
    Kind("rotor lag", "the lag is on the rotors' speed", _rotors, causes="rotor lag", group="law"),
    Kind("reversed", "starboard is reversed", wired=_reversed, causes=r"(signs|reversed).*stbd.*", group="law"),
    Kind("swapped", "port and starboard are swapped", wired=_swapped, causes=r"(signs|swapped) .*", group="law"),
    Kind(
        "limit", "commands end at 45 %", followed=lambda c: np.clip(c, -0.45, 0.45), causes="command limit", group="law"
    ),
    Kind("equal commands", "port and starboard always get the same command", alike=True, group="law", counts=(2,)),
)
"""Vehicles that obey the law, with what the product can name, or with what no log of theirs tells apart."""

_OWN_CURVE = r"curve of its own .*port"

STRANGERS = (
    Kind("power of drag", "quadratic drag has the power 1.5", _power),
    Kind("jets", "port and starboard lose up to 25 % where they push alike", _jets),
    Kind("stale velocity", "a DVL repeats a value for 3 s, four times in each dive", shown=_of_velocities(_stale)),
    Kind("fouling", "drag is 50 % higher after 20 s of the first dive", _fouled),
    Kind("stiction", "a thruster starts at 30 % and stops at 3 %", followed=_stiction),
    Kind("memory", "a force that forgets the velocity within 1.5 s", _remembered),
    Kind("power limit", "the power of all thrusters is limited to 10 % of the full one of two", _limited),
    Kind("turns drag", "turns add as much as the full quadratic drag of surge", _turning),
    Kind("wandering velocity", "an estimator's velocity wanders by 0.04 m/s within 8 s", shown=_of_velocities(_wander)),
    Kind("cubic drag", "a cubic term, at full speed 1.2 times the quadratic one", _cubic),
    Kind("coanda", "jets lose 35 % on the hull at rest, and nothing at speed", _coanda),
    Kind("hidden sway", "turns throw it sideways, which nothing shows", has_hidden_sway=True, counts=(2,)),
    Kind("crisis", "drag falls by 35 % at 45 % of the full speed", _crisis),
    Kind("play", "thrusters follow a command only after 8 %", followed=_play),
    Kind("tether", "drag grows by 1/8 for each metre away", _tether),
    Kind("warming", "thrust falls by 25 % within 30 s", _warming),
    Kind("compass", "the heading deviates by up to 12 degrees", shown=_compass),
    Kind("two shapes", "half of the quadratic drag is linear astern", _two_shapes),
    Kind("jet on a jet", "starboard loses 25 % while port pushes astern", _jet_astern),
    Kind("lost lock", "a DVL shows 0 for 3 s, three times in each dive", shown=_of_velocities(_unlocked)),
    Kind("frame of the earth", "a DVL shows velocities to the north for 3 s, three times", shown=_over_ground),
    Kind("lost blade", "port has 85 % of its thrust ahead, and 55 % astern", _lost_blade, causes=_OWN_CURVE),
    Kind("neutral off", "port gets 4 % more than its command", followed=_neutral_off, causes=r"neutral .*port"),
    Kind("unequal lags", "port is 2.5 times as slow", _unequal_lags),
    Kind("payload", "inertia is 30 % larger after 20 s of the first dive", _payload),
    Kind(
        "turned DVL",
        "the DVL is turned by 25 degrees",
        shown=_turned,
        causes="turned velocity sensor",
        counts=(4,),
    ),
    Kind("own wake", "the water follows by 20 % within 4 s", _wake),
    Kind("ventilation", "thrusters lose 30 % above 40 % of the command", _ventilated),
    Kind("uneven lag", "thrusters start 2.5 times as slowly, and stop twice as fast", _uneven_lag),
    Kind("wall", "drag is 80 % higher beside a wall, and 30 % 2 m away", _wall),
    Kind("heavier", "inertia grows by up to 60 % with speed", _heavier, group="hidden"),
    Kind(
        "scaled velocity",
        "the velocity sensor shows 10 % too much",
        shown=_of_velocities(lambda v, _: 1.1 * v),
        group="hidden",
    ),
    Kind(
        "late velocity",
        "an estimator's velocity lags by 0.6 s",
        shown=_of_velocities(lambda v, _: _filtered(v, 0.6)),
        group="hidden",
    ),
)
KINDS = (AS_MODELLED, *FAULTS, *STRANGERS)
OTHERS = (
    Kind("of 2 kg", "the others weigh 6 to 14 kg", size=0.2, group="law", counts=(4,)),
    Kind("of 100 kg", "the same", size=10.0, group="law", counts=(4,)),
    Kind("unlike 0.94", "port has 94 % of its thrust", _with_strength(0.94), group="law"),
    Kind("unlike 0.97", "port has 97 % of its thrust", _with_strength(0.97), group="law"),
    Kind("unlike 1.03", "port has 103 % of its thrust", _with_strength(1.03), group="law"),
    Kind("places", "arms are 2 % longer, and the lateral thruster 5 mm ahead", reach=1.02, ahead=0.005, group="law"),
    Kind("late commands", "commands act 0.2 s late", wired=_late, group="law"),
    Kind("current", "the water flows with 7 cm/s under a DVL that sees the ground", shown=_drifting, group="law"),
    Kind(
        "slow noise", "an estimator's velocity errs by 2 cm/s for about 1 s", shown=_of_velocities(_slowly), group="law"
    ),
    Kind("jitter", "each time stamp errs by 10 ms", jitter=0.01, group="law"),
    Kind("coarse depth", "the log has depths in steps of 1 cm", steps=0.01, group="law", counts=(1, 4)),
    Kind("cut", "each log lacks 3 s in its middle", is_cut=True, group="law"),
    Kind(
        "near",
        "thrust 1.2 %, lags 4 %, drag 2 %, compass 0.4 degrees, DVL 0.6 % and a swell of 6 mm/s",
        _near,
        shown=_nearly,
    ),
    Kind("lags apart", "port is 8 % slower", _slower),
    Kind("failing thruster", "port has 40 % of its thrust in the second dive", _fails),
    Kind("waves", "waves of 10 cm and 6 s carry it along", shown=_waved, counts=(4,)),
)
"""Kinds that no seed draws by itself."""
BY_NAME = {kind.name: kind for kind in (*KINDS, *OTHERS)}
