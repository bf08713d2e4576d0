"""The dead time: a change of the commands acts T_d seconds later (standard library only)."""

from copy import copy
from math import isfinite

from .layout import Layout, delayed_name
from .rov import Rov, Values

MOST_WAITING = 1024
"""The largest number of changes that may wait, as in fmu_src/c/delay.c."""
_ROUNDING = 16.0 * 2.0**-52


class DelayLine:
    """The commands that act on a vehicle, and the changes that wait for the dead time.

    Before its first command, every thruster is still. For a vehicle without a dead time, nothing waits.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.acting = {name: layout.inputs[name].start for name in layout.commands}
        """The commands that act."""
        self.waiting: list[tuple[float, dict[str, float]]] = []
        """The changes that have not arrived yet: the time at which each arrives, and its commands."""

    def step(self, rov: Rov, inputs: Values, state: Values, t: float, h: float) -> dict[str, float]:
        """Return the states of a vehicle after h > 0 seconds from time t with the inputs held, exact up to rounding.

        Raises ValueError when more than MOST_WAITING changes wait. After that, and after a motion that overflows,
        `waiting` is the same as before the step.
        """
        if not self.layout.has_dead_time:
            return rov.step(inputs, state, h)
        line = copy(self)
        line.waiting = [*self.waiting]
        line._send({name: inputs[name] for name in self.acting}, t + rov["T_d"])
        passed, after = 0.0, dict(state)
        while passed < h:
            line._receive(t + passed)
            until = min(h, line.waiting[0][0] - t) if line.waiting else h
            after = rov.step({**inputs, **line.delayed}, after, until - passed)
            passed = until
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

    def move(self, shift: float) -> None:
        """Shift the times of all waiting changes, for an importer that sets the time to another value."""
        self.waiting = [(arrival + shift, commands) for arrival, commands in self.waiting]

    def _send(self, commands: dict[str, float], arrival: float) -> None:
        if commands == (self.waiting[-1][1] if self.waiting else self.acting):
            return
        if self.waiting and self.waiting[-1][0] >= arrival:
            self.waiting[-1] = arrival, commands
        elif len(self.waiting) == MOST_WAITING:
            raise ValueError(
                f"more than {MOST_WAITING} changes of commands wait for the dead time; change them less often"
            )
        else:
            self.waiting.append((arrival, commands))

    def _receive(self, t: float) -> None:
        while self.waiting and self.waiting[0][0] <= t + _ROUNDING * abs(t):
            _, self.acting = self.waiting.pop(0)
