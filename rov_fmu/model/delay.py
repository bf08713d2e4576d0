"""The dead time: a change of the commands acts T_d seconds later (standard library only)."""

from copy import copy
from math import isfinite
from typing import NamedTuple

from .catalogue import delayed_name
from .layout import Layout
from .rov import Rov, Values

MOST_WAITING = 1024
"""The largest number of changes that may wait, as in fmu_src/c/delay.c."""
_ROUNDING = 4.0 * 2.0**-52  # of a time and of a remaining time, per second


class Change(NamedTuple):
    """A change of the commands that waits for the dead time.

    It has the time that it still takes. The time at which it arrives would have fewer digits late in a run.
    """

    remaining: float
    """The time until it arrives, s."""
    commands: dict[str, float]
    lost: float = 0.0
    """The rounding error of the remaining time, which would add up over many small steps."""

    def after(self, h: float) -> "Change":
        """Return the same change h seconds later."""
        passed = self.lost - h
        remaining = self.remaining + passed
        return Change(remaining, self.commands, passed - (remaining - self.remaining))


class DelayLine:
    """The commands that act on a vehicle, and the changes that wait for the dead time.

    Before its first command, every thruster is still. For a vehicle without a dead time, nothing waits.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.acting = {name: layout.inputs[name].start for name in layout.commands}
        """The commands that act."""
        self.waiting: list[Change] = []
        """The changes that have not arrived yet. Their remaining times never fall."""

    def step(self, rov: Rov, inputs: Values, state: Values, t: float, h: float) -> dict[str, float]:
        """Return the states of a vehicle after h > 0 seconds from time t with the inputs held, exact up to rounding.

        Raises ValueError when more than MOST_WAITING changes wait. After that, and after a motion that overflows,
        `waiting` is the same as before the step.
        """
        if not self.layout.has_dead_time:
            return rov.step(inputs, state, h)
        line = copy(self)
        line._send({name: inputs[name] for name in self.acting}, rov["T_d"])
        passed, after = 0.0, dict(state)
        while passed < h:
            line._receive(t, passed)
            until = min(h, line.waiting[0].remaining) if line.waiting else h
            after = rov.step({**inputs, **line.delayed}, after, until - passed)
            passed = until
        line.waiting = [change.after(h) for change in line.waiting]
        line._receive(t + h)
        if all(map(isfinite, after.values())):
            self.acting, self.waiting = line.acting, line.waiting
        return after

    @property
    def delayed(self) -> dict[str, float]:
        """The commands that act, by the names of the variables for them."""
        if not self.layout.has_dead_time:
            return {}
        return {delayed_name(name): value for name, value in self.acting.items()}

    def _send(self, commands: dict[str, float], dead_time: float) -> None:
        if commands == (self.waiting[-1].commands if self.waiting else self.acting):
            return
        kept = [change for change in self.waiting if change.remaining < dead_time]
        if len(kept) == MOST_WAITING:
            raise ValueError(
                f"more than {MOST_WAITING} changes of commands wait for the dead time; change them less often"
            )
        self.waiting = [*kept, Change(dead_time, commands)]

    def _receive(self, t: float, passed: float = 0.0) -> None:
        while self.waiting and self.waiting[0].remaining - passed <= _ROUNDING * (1.0 + abs(t)):
            self.acting, self.waiting = self.waiting[0].commands, self.waiting[1:]
