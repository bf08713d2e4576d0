"""Steps with absurd sizes and loads end soon, with a finite result or with an error that keeps the state."""

import math
import random
import time
from pathlib import Path

import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import python
from tests.equation.steps import in_engine, in_python
from tests.fmi import ERROR, OK
from tests.fmi2 import Fmu
from tests.often import often
from tests.vehicles import at_rest, still

_DRAG = [("a_d_u", "b_d_u"), ("a_d_r", "b_d_r")]


def _cases(count: int) -> list[tuple[float, dict[str, float]]]:
    """Return step sizes and values to set: motions without drag, forces that overflow, and some with random values."""
    ahead = {"u_l": 0.3}
    cases = [(1e300, ahead | {a: 0.0, b: 0.0}) for a, b in _DRAG] + [(1e308, ahead), (5e-324, ahead)]
    cases += [(6e-6, {"N_ext": 1.1e118, "u": 1e90}), (1.0, {"r": 1e40}), (1e3, {"u": 1e154, "r": 1e154})]
    random_ = random.Random(3)
    names = ("u_l", "u_r", "X_ext", "N_ext", "u", "r", "psi")
    for _ in range(count):
        power = 10.0 ** random_.uniform(0.0, 2.5)
        values = {name: random_.choice((-1.0, 0.0, 1.0)) * 10.0 ** random_.uniform(-power, power) for name in names}
        cases.append((10.0 ** random_.uniform(-power, power), {k: v for k, v in values.items() if math.isfinite(v)}))
    return cases


def step_them_all(folder: str, count: int) -> None:
    """Step an instance for each case. An AssertionError names the case that fails."""
    fmu = Fmu(Path(folder))
    states = fmu.states
    for h, values in _cases(count):
        with fmu.instance() as rov:
            rov.start(values)
            before = rov.get(states)
            start = time.process_time()
            status = rov.call("fmi2DoStep", 0.0, h, 1)
            seconds = time.process_time() - start
            after = rov.get(states)
            case = (h, values, seconds, before, after)
            assert status in {OK, ERROR}, case
            assert all(map(math.isfinite, after)), case
            assert status == OK or after == before, case
            assert seconds < 5.0, case  # 100,000 pieces take about a tenth of a second


@often("count", 2, 150)
def test_steps_of_absurd_size_end(count: int, videoray_dir: Path) -> None:
    # in a separate process, because a step that does not end cannot be interrupted
    code = f"from tests.equation.test_extremes import step_them_all; step_them_all({str(videoray_dir)!r}, {count})"
    python("-c", code, timeout=120)


@pytest.mark.parametrize(("load", "h"), [({"X_ext": 1e20}, 100.0), ({"X_ext": 1e30}, 1e-3), ({"N_ext": 1e20}, 1e-3)])
def test_a_step_in_which_time_hardly_passes_is_refused_soon(load: dict[str, float], h: float) -> None:
    """The vehicle would turn a million times in a millisecond, and each turn needs a few pieces."""
    rov = load_vehicle(SHIPPED["bluerov2_heavy"])
    inputs, state = still(rov) | load, at_rest(rov)
    in_engine(rov, inputs, state, 1e-9)  # compiles the engine
    for step in (in_engine, in_python):
        start = time.process_time()
        assert not any(map(math.isfinite, step(rov, inputs, state, h).values())), step
        assert time.process_time() - start < 2.0, step
