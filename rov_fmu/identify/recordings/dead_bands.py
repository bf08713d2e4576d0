"""The uncertainty of a dead band and of the linear thrust. If b_t is near 0, it does not follow from derivatives.

The thrust is a_t m^2 + b_t m with m = |command| - c_0. If c_0 grows by h and b_t by 2 a_t h, it changes by the constant
-(b_t + a_t h) h. Near b_t = 0 the derivative along this direction vanishes, so derivatives would give infinite errors
of c_0 and b_t, although the data determine both. A secant along the direction includes the term with h^2.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf

import numpy as np
from scipy.optimize import brentq

from rov_fmu.identify.effects.dead_band import DeadBand
from rov_fmu.identify.least_squares import covariance
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.model.layout import REVERSE
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import quantile

_LENGTHS = 1e-5, 0.3
"""The shortest and the longest secant, as a change of c_0."""


def with_secants(analysis: ResidualAnalysis) -> ResidualAnalysis:
    """Return the analysis with secants in place of derivatives by dead bands, where b_t may be 0."""
    J = analysis.solution.jacobian.copy()
    for n, direction, room in _directions(analysis.model, analysis.x):
        _take_secant(analysis, J, n, direction, room)
    if np.array_equal(J, analysis.solution.jacobian):
        return analysis
    return ResidualAnalysis(analysis.model, replace(analysis.solution, jacobian=J), robust=analysis.robust)


def _take_secant(analysis: ResidualAnalysis, J: Array, n: int, direction: Array, room: float) -> None:
    """Replace column n of J, the derivatives by a c_0, if half of its interval is longer than the room.

    The new column is that of a secant along the direction, which is as long as half of the new interval. This half is
    at least as long as the room.
    """
    derivative, others = J[:, n].copy(), direction.copy()
    others[n] = 0.0
    reach = quantile(max(analysis.degrees_of_freedom, 1.0))

    def half() -> float:
        return reach * float(np.sqrt(covariance(J.T @ J)[n, n]))

    def excess(length: float) -> float:
        """Take a secant of this length; return how much longer half of the interval then is."""
        change = analysis.model.residuals(analysis.x + length * direction) - analysis.solution.residuals
        J[:, n] = change / length - J @ others
        return min(half(), 1.0) - max(length, room) if np.isfinite(change).all() else -inf

    if half() > room:
        if excess(_LENGTHS[0]) > 0.0 > excess(_LENGTHS[1]):
            brentq(excess, *_LENGTHS, xtol=1e-4)
        if not np.isfinite(J[:, n]).all():
            J[:, n] = derivative


def _directions(model: Simulator, x: Array) -> Iterator[tuple[int, Array, float]]:
    """Yield the place of each fitted c_0, the direction in x that hardly changes the thrust, and the room.

    Along the direction, b_t changes together with c_0. If both directions of command share the dead band, both b_t
    change. `room` is the decrease of c_0 at which one b_t becomes 0.
    """
    rov = model.rov(x)
    names = [*model.names, *(f"c_0_{e.of}" if isinstance(e, DeadBand) else "" for e in model.extras)]
    for curve in rov.layout.curves:
        for dead in dict.fromkeys(curve.coefficient("c_0" + end) for end in ("", REVERSE)):
            if dead not in names:
                continue
            n, rooms = names.index(dead), []
            direction = np.zeros(len(x))
            direction[n] = 1.0
            for end in ("", REVERSE):
                a_t, b_t, c_0 = (curve.coefficient(key + end) for key in ("a_t", "b_t", "c_0"))
                if c_0 == dead and b_t in names and rov[a_t] > 0.0:
                    direction[names.index(b_t)] = 2.0 * rov[a_t]
                    rooms.append(rov[b_t] / (2.0 * rov[a_t]))
            if rooms:
                yield n, direction, min(rooms)
