"""Folders of dives of vehicles that are drawn anew with each seed, and their truth.

Each has two dives with a logger of 10 Hz, a table of thrust, and rov.toml. An even seed has a stranger, and an odd one
a vehicle that obeys the law; the kinds take turns.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from verification.identification.strangers.kinds import AS_MODELLED, FAULTS, STRANGERS, Kind
from verification.identification.strangers.water import (
    AXES,
    DRIVEN,
    HEAVE,
    ROW,
    SURGE,
    SWAY,
    THRUSTERS,
    YAW,
    Array,
    Body,
    Water,
    answers,
    flown,
)

DIVES = 2
_AXES = {1: (HEAVE,), 2: (SURGE, YAW), 4: (SURGE, SWAY, HEAVE, YAW)}
"""The axes of a vehicle by their number."""
_NOISE = {SURGE: 0.008, SWAY: 0.008, HEAVE: 0.006, YAW: np.radians(0.4)}
"""The standard deviation of each sensor: m/s, m/s, m, rad."""
HEADERS = {
    SURGE: "surge velocity [m/s]",
    SWAY: "sway velocity [m/s]",
    HEAVE: "depth [m]",
    YAW: "heading [deg]",
}
_BENCH = np.array([-1.0, -0.8, -0.6, -0.4, -0.25, -0.15, -0.08, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 1.0])
_HEAD = """[vehicle]
name = "stranger"
identifier = "stranger"
version = "1"
description = "A simulated vehicle"
source = "simulated"

[body]
m_rov = {{ value = {mass:.6g}, unit = "kg", source = "weighed" }}
I_r = {{ value = {turning:.6g}, unit = "kg.m2", source = "drawn" }}
{coupling}
[curves.main]
"""
_THRUSTER = """
[[thruster]]
name = "{name}"
curve = "main"
direction = {{ value = [{x}, {y}, {z}], source = "drawn" }}
position = {{ value = [0.0, {place:.6g}, 0.0], unit = "m", source = "drawn" }}
"""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A folder of dives, by its seed and the number of axes of its vehicle: 2, 4, or 1 for heave alone."""

    seed: int
    count: int
    kind: Kind
    body: Body
    commands: Array
    """rows x 4 x dives: as they are logged."""
    begins: Array
    """The clock at the begin of each dive, s."""

    @property
    def axes(self) -> tuple[int, ...]:
        """The axes that the vehicle is said to have."""
        return _AXES[self.count]

    @property
    def thrusters(self) -> dict[int, str]:
        """The thrusters along these axes."""
        return {n: name for n, name in enumerate(THRUSTERS) if DRIVEN[self.axes, n].any()}

    @cached_property
    def water(self) -> Water:
        return Water(self.body, self.kind.act)

    @cached_property
    def followed(self) -> Array:
        """The commands that the thrusters follow."""
        return self.kind.followed(self.kind.wired(self.commands))

    @cached_property
    def motion(self) -> Array:
        """The true states in each row, rows x 16 x dives."""
        heading = np.random.default_rng([self.seed, self.count, 1]).uniform(-3.0, 3.0, DIVES)
        return flown(self.water, self.followed, self.begins, heading, 2.0)

    @cached_property
    def columns(self) -> dict[int, Array]:
        """What the sensor of each axis shows without white noise: velocities in surge and sway, depth, and heading."""
        states = {SURGE: SURGE, SWAY: SWAY, HEAVE: 6, YAW: 7}
        columns = {axis: self.motion[:, states[axis]].copy() for axis in self.axes}
        self.kind.shown(columns, np.random.default_rng([self.seed, self.count, 2]))
        return columns

    def truth(self, axis: int, commands: list[float]) -> Array:
        """Return V_ss, the time to 63 % and the stopping distance for each command along an axis, 3 x n.

        What changes with time has its value at the end of the last dive. A command begins at rest.
        """
        asked = DRIVEN[axis][:, None] * np.array(commands)
        followed = self.kind.followed(np.array([0.0 * asked, asked, asked]))[-1]
        return answers(self.water, axis, followed, float(self.begins[-1]) + ROW * len(self.commands))

    def write(self, folder: Path) -> None:
        """Write rov.toml, the table of thrust, and the logs."""
        random, b = np.random.default_rng([self.seed, self.count, 3]), self.body
        late = np.random.default_rng([self.seed, self.count, 4]).standard_normal((len(self.commands), DIVES))
        text = _HEAD.format(mass=b.mass, turning=b.turning, coupling="coupling = true\n" if self.count == 4 else "")
        for n, name in self.thrusters.items():
            x, y, z = (DRIVEN[axis, n] for axis in (SURGE, SWAY, HEAVE))
            text += _THRUSTER.format(name=name, x=x, y=y, z=z, place=(-b.arm, b.arm, 0.0, 0.0)[n])
        text += "\n" + "".join(f"[axes.{AXES[axis]}]\n" for axis in self.axes)
        forces = self.water.bench(_BENCH)
        noise = 0.015 * forces * random.standard_normal(14) + 0.003 * b.full * random.standard_normal(14)
        table = {"thrust_main.csv": _csv(["command [%]", "force [N]"], [100.0 * _BENCH, forces + noise])}
        if not self.kind.has_table:
            about = f'[curves.main]\nthrust = {{ about = {0.95 * b.full:.4g}, unit = "N" }}\n'
            text, table = text.replace("[curves.main]\n", about), {}
        files = {"rov.toml": text, **table}
        for dive in range(DIVES):
            heads = ["time [s]", *(f"{name} [%]" for name in self.thrusters.values())]
            stamps = ROW * np.arange(len(self.commands)) + self.kind.jitter * late[:, dive]
            values = [stamps, *(100.0 * self.commands[:, [*self.thrusters], dive].T)]
            for axis in self.axes:
                shown = self.columns[axis][:, dive] + _NOISE[axis] * random.standard_normal(len(self.commands))
                if axis == HEAVE and self.kind.steps:
                    shown = self.kind.steps * np.round(shown / self.kind.steps)
                heads.append(HEADERS[axis])
                values.append(np.degrees(shown) % 360.0 if axis == YAW else shown)
            if self.kind.is_cut:
                at = abs(values[0] - 0.5 * values[0][-1]) > 1.5
                values = [column[at] for column in values]
            files[f"dive_{dive}.csv"] = _csv(heads, values)
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).write_text(content, encoding="utf-8")


def _csv(heads: list[str], columns: list[Array]) -> str:
    rows = (",".join(f"{value:.5g}" for value in row) for row in zip(*columns, strict=True))
    return "\n".join([",".join(heads), *rows, ""])


def kind_of(seed: int, count: int) -> Kind:
    """Return the kind of a seed: a stranger if it is even; otherwise every third one has a fault."""
    turn = seed // 2
    if seed % 2 == 0:
        some = [kind for kind in STRANGERS if count in kind.counts]
        return some[turn % len(some)]
    some = [kind for kind in FAULTS if count in kind.counts]
    return some[turn // 3 % len(some)] if turn % 3 == 2 else AS_MODELLED


def draw(seed: int, count: int, kind: Kind | None = None) -> Drawn:
    """Draw the vehicle and the dives of a seed."""
    random = np.random.default_rng([seed, count])
    kind = kind or kind_of(seed, count)
    body = _body(random, count, kind)
    rows = round(random.uniform(40.0, 55.0) / ROW)
    commands = np.stack([_pilot(random, rows, count, kind) for _ in range(DIVES)], axis=2)
    return Drawn(seed, count, kind, body, commands, ROW * rows * np.arange(float(DIVES)))


def _body(random: np.random.Generator, count: int, kind: Kind) -> Body:
    mass, full, arm = random.uniform(6.0, 14.0), random.uniform(18.0, 40.0), random.uniform(0.12, 0.2)
    length = kind.size ** (1.0 / 3.0)
    mass, full, arm = mass * kind.size, full * length**2, arm * length
    turning = mass * random.uniform(0.014, 0.024) * length**2
    added = random.uniform((1.2, 1.5, 1.5, 1.3), (1.6, 2.2, 2.2, 1.9))
    top = random.uniform((1.2, 0.5, 0.6, 3.0), (1.7, 0.8, 1.0, 5.0))
    linear = random.uniform(0.08, 0.25, 4)
    push = full * np.array([2.0, 1.0, 1.0, 1.8 * arm])
    astern = np.where([True, False, True, False], random.uniform(0.9, 1.15, 4), 1.0)
    if kind.has_hidden_sway:
        push = push * np.array([1.0, 4.0, 1.0, 1.0])  # a hull that slips sideways a little
    load = random.uniform(-0.015, 0.015) * full
    return Body(
        mass=mass,
        turning=turning,
        inertia=added * np.array([mass, mass, mass, turning]),
        quadratic=(1.0 - linear) * push / top**2,
        linear=linear * push / top,
        astern=astern,
        top=top,
        load=load if HEAVE in _AXES[count] else 0.0,
        arm=arm,
        full=full,
        reverse=random.uniform(0.7, 1.0),
        dead_band=random.uniform(0.02, 0.06),
        loss=random.uniform(0.0, 0.15),
        lag=random.uniform(0.05, 0.2) * length,
        coupled=count == 4 or kind.has_hidden_sway,
        reach=kind.reach,
        ahead=kind.ahead,
    )


def _pilot(random: np.random.Generator, rows: int, count: int, kind: Kind) -> Array:
    """Return the logged commands of a dive, rows x 4: levels along each axis that are held for a while."""
    sticks = np.zeros((rows, 4))
    for axis in _AXES[count]:
        at, most = 20, random.uniform(0.55, 0.75) if axis != YAW else random.uniform(0.35, 0.6)
        while at < rows:
            end = at + int(random.integers(8, 50))
            sticks[at:end, axis] = random.choice([0.0, -1.0, 1.0], p=[0.25, 0.35, 0.4]) * random.uniform(0.15, most)
            at = end
    if kind.alike:
        sticks[:, YAW] = 0.0
    return np.asarray(np.round(np.clip(sticks @ DRIVEN, -1.0, 1.0), 3))
