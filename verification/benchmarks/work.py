"""The same work for all: seeded commands, held, and where each ends to 50 digits."""

import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rov_fmu.engine.simulation import simulate
from rov_fmu.model.rov import Rov
from verification.references import reference

SEED = 1
Values = Mapping[str, float]


def flight(rov: Rov, commands: Sequence[Values], hold: float) -> list[Values]:
    """Return the state at rest, and after each command, held for so many s."""
    times = hold * np.arange(len(commands) + 1.0)
    inputs = {name: [*(command[name] for command in commands), 0.0] for name in rov.layout.inputs}
    states = simulate(rov, times, inputs).values[:, 0]
    return [dict(zip(rov.layout.state, row, strict=True)) for row in states.T.tolist()]


@dataclass(frozen=True, eq=False)
class Work:
    """Commands of -1 ... 1, each held for `hold` s; the first `starts` of them from known states."""

    rov: Rov
    straight: bool
    """The first two commands are the same, so that the heading of the VideoRay stays."""
    hold: float
    commands: int
    starts: int
    ahead: bool = False
    """All commands positive, so that nothing turns back."""
    one_way: bool = False
    """All commands positive and the first at least the second: the VideoRay turns, and no velocity turns back."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the commands."""
        return tuple(self.rov.layout.commands)

    @cached_property
    def array(self) -> NDArray[np.float64]:
        """The commands, a row each: with another length of the sequence the same ones."""
        rng = random.Random(SEED)
        drawn = np.array([[rng.uniform(-1.0, 1.0) for _ in self.names] for _ in range(self.commands)])
        if self.straight:
            drawn[:, 1] = drawn[:, 0]
        if self.one_way:
            drawn = np.abs(drawn)
            drawn[:, :2] = -np.sort(-drawn[:, :2])
        return np.abs(drawn) if self.ahead else drawn

    @cached_property
    def sequence(self) -> list[Values]:
        """All inputs at each command."""
        still = dict.fromkeys(self.rov.layout.inputs, 0.0)
        return [still | dict(zip(self.names, row, strict=True)) for row in self.array.tolist()]

    @cached_property
    def states(self) -> NDArray[np.float64]:
        """Where the first commands start: each where the one before ends after a second, the first at rest."""
        return np.array([list(s.values()) for s in flight(self.rov, self.sequence[: self.starts - 1], 1.0)])

    @cached_property
    def ends(self) -> list[list[reference.Number]]:
        """The states at the ends of the first commands, to 50 digits."""
        names = list(self.rov.layout.state)
        return [
            list(reference.step(self.rov, command, dict(zip(names, start, strict=True)), self.hold).state.values())
            for command, start in zip(self.sequence, self.states.tolist(), strict=False)
        ]

    def error(self, found: Iterable[Sequence[float]]) -> float:
        """The largest difference of any state (SI units) of the first ones that were found."""
        return max(
            abs(float(exact - value))
            for end, values in zip(self.ends, found, strict=True)
            for exact, value in zip(end, values, strict=False)
        )
