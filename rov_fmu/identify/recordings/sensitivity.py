"""The derivatives of a simulated recording by each coefficient and extra, along a run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rov_fmu.identify.effects.coupling import EAST, NORTH
from rov_fmu.identify.effects.extras import Extra
from rov_fmu.identify.recordings.runs import ForcedRun, PreparedRecording, at_samples, lagging
from rov_fmu.identify.recordings.trajectory import Slopes, Steps, recursion
from rov_fmu.model.layout import REVERSE, Curve
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import is_factor


@dataclass(frozen=True, eq=False)
class _Local:
    """The effect of a parameter within each of N steps: on the end velocity, the distance and the initial velocity."""

    end: Array
    distance: Array
    jump: Array


class Sensitivity:
    """The sensitivity of one run, from its steps and their derivatives."""

    def __init__(self, rov: Rov, forced: ForcedRun, steps: Steps, end: Slopes, distance: Slopes) -> None:
        self._rov, self._forced, self._steps, self._end, self._by_distance = rov, forced, steps, end, distance
        self._gain = rov.gain(forced.form)
        self._by_force = self._gain * rov[forced.form.axis.coefficient("alpha")]

    def by(
        self, data: PreparedRecording, names: Sequence[str], extras: Sequence[Extra]
    ) -> dict[str | Extra | int, Array]:
        """Return the derivatives of n samples by coefficients (internal), extras, initial values (0: v, 1: s)."""
        local: dict[str | Extra | int, _Local] = {0: self._local()}
        local[0].jump[0] = 1.0
        for name in names:
            if (of_name := self._by_coefficient(name)) is not None:
                local[name] = of_name
        for extra in extras:
            if extra.kind == "load":
                local[extra] = self._local(C=np.full_like(self._steps.h, self._gain))
            elif extra.kind == "delay":
                local[extra] = self._by_delay()
            elif (by_flow := self._by_coupling(extra.kind)) is not None:
                local[extra] = by_flow
        run = self._forced.run
        jump, end, distance = (
            np.column_stack([getattr(x, key) for x in local.values()]) for key in ("jump", "end", "distance")
        )
        nodes = np.zeros((len(run.h) + 1, len(local)))
        nodes[:-1] = jump
        nodes[1:] += end
        v = recursion(np.append(self._end.v, 0.0), nodes)
        is_position = data.recording.is_position
        values = at_samples(run, self._by_distance.v[:, None] * v[:-1] + distance) if is_position else v[run.sample]
        found: dict[str | Extra | int, Array] = {key: values[:, n] for n, key in enumerate(local)}
        if is_position:
            found[1] = np.ones(len(data.time))
        elapsed = data.time - data.time[0] if is_position else np.ones(len(data.time))
        for extra in extras:
            if extra.kind == "current":
                found[extra] = elapsed
            elif extra.is_current:
                found[extra] = data.carried[[NORTH, EAST].index(extra.kind)] + found.get(extra, 0.0)
        return found

    def _local(self, **changes: Array) -> _Local:
        """Return the effect of changes of A, B (2 x N), C (N), D, kappa (K x N)."""

        def total(slopes: Slopes) -> Array:
            products = (np.atleast_2d(getattr(slopes, key) * change) for key, change in changes.items())
            return np.asarray(sum((p.sum(axis=0) for p in products), np.zeros_like(self._steps.h)))

        end = total(self._end)
        return _Local(end, total(self._by_distance), np.zeros_like(end))

    def _by_coefficient(self, name: str) -> _Local | None:
        form, steps = self._forced.form, self._steps
        if name == form.axis.coefficient("beta"):
            return self._local(A=steps.A, B=steps.B, C=steps.C, D=steps.D)
        if is_factor(name):  # β of another axis
            return self._by_coupling(name)
        if "F_0" in form.keys and name == form.coefficient("F_0"):
            return self._local(C=np.full_like(steps.h, self._gain))
        for key, letter in (("a_d", "A"), ("b_d", "B")):
            sides = [self._gain if form.coefficient(key + end) == name else 0.0 for end in ("", REVERSE)]
            if any(sides):
                return self._local(**{letter: np.outer(sides, np.ones_like(steps.h))})
        return self._by_thrust(name)

    def _by_coupling(self, name: str) -> _Local | None:
        """Return the effect of β of another axis, or of the current."""
        coupling = self._forced.coupling
        slope = coupling.slopes.get(name) if coupling else None
        return None if slope is None else self._local(C=self._gain * slope)

    def _by_thrust(self, name: str) -> _Local | None:
        run, D, kappa = self._forced.run, np.zeros_like(self._steps.D), np.zeros_like(self._steps.kappa)
        C, concerned = np.zeros_like(run.h), False
        for n, (curve, push) in enumerate(self._forced.pushes):
            line = self._line(n)
            if line is not None and name == curve.coefficient("T"):
                rate, lagging_force, target = self._lag(curve), self._forced.lags[line][1], push.force[run.hold]
                fall, by_T = np.exp(-rate * run.h), -rate * rate
                falling = -run.h * (lagging_force - target) * fall
                D[line] = self._by_force * by_T * recursion(fall, np.concatenate([[0.0], falling[:-1]]))
                kappa[line], concerned = by_T, True
            elif name in push.slopes:
                steady = push.slopes[name]
                C += self._by_force * steady[run.hold]
                if line is not None:
                    D[line] = self._by_force * (lagging(run, steady, self._lag(curve)) - steady[run.hold])
                concerned = True
        return self._local(C=C, D=D, kappa=kappa) if concerned else None

    def _by_delay(self) -> _Local:
        """Return the effect of a delay: until the commands change, the forces are the previous ones."""
        run, D, jump = self._forced.run, np.zeros_like(self._steps.D), np.zeros_like(self._steps.h)
        at = run.switched
        for n, (curve, push) in enumerate(self._forced.pushes):
            change = push.force[run.hold[at]] - push.force[run.hold[at - 1]]
            line = self._line(n)
            if line is None:
                jump[at] -= self._by_force * change
            else:
                rate, terms = self._lag(curve), np.zeros_like(run.h)
                terms[at] = -rate * change
                D[line] = self._by_force * recursion(np.exp(-rate * run.h), terms)
        found = self._local(D=D)
        found.jump[:] = jump
        return found

    def _line(self, n: int) -> int | None:
        """Return the index of a curve among the lagging forces."""
        return next((line for line, (of, _) in enumerate(self._forced.lags) if of == n), None)

    def _lag(self, curve: Curve) -> float:
        return 1.0 / self._rov[curve.coefficient("T")]
