"""The commands that every method simulates, and their exact final states."""

import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references import reference, rigid_vehicle

SEED = 1
Values = Mapping[str, float]


def flight(rov: Vehicle, commands: Sequence[Values], hold: float) -> list[Values]:
    """Return the state at rest, and after each command, held for so many s."""
    times = hold * np.arange(len(commands) + 1.0)
    inputs = {name: [*(command[name] for command in commands), 0.0] for name in rov.layout.inputs}
    states = simulate(rov, times, inputs).values[:, 0]
    return [dict(zip(rov.layout.state, row, strict=True)) for row in states.T.tolist()]


@dataclass(frozen=True, eq=False)
class Work:
    """Commands of -1 ... 1, each held for `hold` s; the first `starts` of them from known states."""

    rov: Vehicle
    hold: float
    commands: int
    starts: int
    straight: bool = False
    """The first two commands are the same, so that the heading of the VideoRay stays."""
    one_way: bool = False
    """All commands are positive and the first is at least the second: the VideoRay turns and no velocity reverses."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the commands."""
        return tuple(self.rov.layout.commands)

    @cached_property
    def array(self) -> NDArray[np.float64]:
        """The commands, one in each row. A longer sequence begins with the same commands."""
        rng = random.Random(SEED)
        drawn = np.array([[rng.uniform(-1.0, 1.0) for _ in self.names] for _ in range(self.commands)])
        if self.straight:
            drawn[:, 1] = drawn[:, 0]
        if self.one_way:
            drawn = np.abs(drawn)
            drawn[:, :2] = -np.sort(-drawn[:, :2])
        return drawn

    @cached_property
    def sequence(self) -> list[Values]:
        """All inputs for each command."""
        still = dict.fromkeys(self.rov.layout.inputs, 0.0)
        return [still | dict(zip(self.names, row, strict=True)) for row in self.array.tolist()]

    @cached_property
    def states(self) -> NDArray[np.float64]:
        """The states at which the first commands start: rest, then the state after 1 s of the command before."""
        return np.array([list(s.values()) for s in flight(self.rov, self.sequence[: self.starts - 1], 1.0)])

    @cached_property
    def ends(self) -> list[list[reference.Number]]:
        """The states at the end of the first commands, to 50 digits, or to 13 for a vehicle with an attitude."""
        names = list(self.rov.layout.state)
        found = []
        for command, start in zip(self.sequence, self.states.tolist(), strict=False):
            state = dict(zip(names, start, strict=True))
            if self.rov.layout.has_attitude:
                found.append(rigid_vehicle.end(self.rov, command, state, self.hold))
            else:
                found.append(list(reference.step(self.rov, command, state, self.hold).state.values()))
        return found

    def error(self, found: Iterable[Sequence[float]]) -> float:
        """Return the largest error of any of these states (SI units)."""
        return max(
            abs(float(exact - value))
            for end, values in zip(self.ends, found, strict=True)
            for exact, value in zip(self._signed(end), self._signed(values), strict=True)
        )

    def _signed(self, state: Sequence[reference.Number]) -> list[reference.Number]:
        """Return a state with eta >= 0, because a quaternion and its negative are the same attitude."""
        named = dict(zip(self.rov.layout.state, state, strict=True))
        sign = -1.0 if named.get("eta", 1.0) < 0.0 else 1.0
        return [sign * x if name in QUATERNION else x for name, x in named.items()]
