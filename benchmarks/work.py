"""The same work for all: seeded commands, held, and where each ends to 50 digits."""

import random
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cached_property
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from checks import reference
from rov_fmu.motion import rov
from rov_fmu.motion.rov import Coefficients, Inputs, State

SEED = 1
STATES = tuple(field.name for field in fields(State))
COMMANDS = ("u_l", "u_r", "u_t")


def flight(k: Coefficients, commands: Sequence[Inputs], hold: float) -> list[State]:
    """From rest, and after each command, held for so many s."""
    return list(accumulate(commands, lambda state, command: rov.step(k, command, state, hold), initial=State()))


@dataclass(frozen=True)
class Work:
    """Commands (u_l, u_r, u_t) of -1 ... 1, each held for `hold` s; the first `starts` of them from known states."""

    coefficients: Coefficients
    straight: bool
    """u_l = u_r, so that the heading stays."""
    hold: float
    commands: int
    starts: int
    ahead: bool = False
    """All commands positive, so that nothing turns back."""

    @cached_property
    def sequence(self) -> list[Inputs]:
        """The commands: with another length of the sequence the same ones."""
        rng = random.Random(SEED)
        drawn = ([rng.uniform(-1.0, 1.0) for _ in range(3)] for _ in range(self.commands))
        signed = ([abs(c) for c in commands] if self.ahead else commands for commands in drawn)
        return [Inputs(left, left if self.straight else right, top) for left, right, top in signed]

    @cached_property
    def array(self) -> NDArray[np.float64]:
        """The commands, a row each."""
        return np.array([[getattr(command, name) for name in COMMANDS] for command in self.sequence])

    @cached_property
    def states(self) -> NDArray[np.float64]:
        """Where the first commands start: each where the one before ends after a second, the first at rest."""
        return np.array([astuple(s) for s in flight(self.coefficients, self.sequence[: self.starts - 1], 1.0)])

    @cached_property
    def ends(self) -> list[dict[str, reference.Number]]:
        """The states at the ends of the first commands, to 50 digits."""
        return [
            reference.step(self.coefficients, command, State(*start), self.hold).state
            for command, start in zip(self.sequence, self.states.tolist(), strict=False)
        ]

    def error(self, found: Iterable[Sequence[float]]) -> float:
        """The largest difference of any state (m/s, rad/s, m, rad) of the three or seven that were found."""
        return max(
            abs(float(end[name] - value))
            for end, values in zip(self.ends, found, strict=True)
            for name, value in zip(STATES, values, strict=False)
        )
