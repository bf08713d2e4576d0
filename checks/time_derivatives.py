"""Time derivatives of a held motion to 50 digits, by differences of Euler's method with a step of 1e-60 s.

The n-th difference of x(k + 1) = x(k) + h f(x(k)) over h^n is the n-th derivative but for a share of h: no series, no
formula of rov_fmu/motion/.
"""

from collections.abc import Mapping
from itertools import pairwise

from mpmath import mp

from rov_fmu.motion.layout import YAW
from rov_fmu.motion.rov import Rov

from .equations import Number, effect, equations

_STEP = 60
"""Digits behind the point of a step, and of the result."""


def time_derivatives(
    rov: Rov, inputs: Mapping[str, float], state: Mapping[str, float], highest: int
) -> list[dict[str, Number]]:
    """Of all outputs, from the first order to the highest; where a velocity is at rest, those of what comes after."""
    with mp.workdps(_STEP * (highest + 1) + 40):  # a difference loses 60 digits
        h = mp.mpf(10) ** -_STEP
        of = equations(rov, inputs)
        now = {name: mp.mpf(state[name]) for name in rov.layout.state}
        table = [now]
        for _ in range(highest):
            rates = of.rates(now, inputs)
            now = {name: x + h * rates[name] for name, x in now.items()}
            table.append(now)
        found = []
        for _ in range(highest):
            table = [{name: (after[name] - x) / h for name, x in before.items()} for before, after in pairwise(table)]
            found.append(_with_torques(rov, table[0]))
        return found


def _with_torques(rov: Rov, rates: Mapping[str, Number]) -> dict[str, Number]:
    """With the forces that do not lag, which are constant, and the torques."""
    layout = rov.layout
    forces = {t.name: rates.get(f"F_{t.name}", mp.zero) for t in layout.thrusters}
    torques = {
        f"tau_{curve.name}": mp.fsum(
            effect(rov, t, "r") * forces[t.name] for t in layout.thrusters if t.curve == curve.name
        )
        for curve in layout.curves
    }
    return {**rates, **{f"F_{name}": F for name, F in forces.items()}, **(torques if layout.has(YAW) else {})}
