"""Model Exchange: an integrator of the importer gives the trajectory of the exact steps, and there are no events."""

from math import inf, nan

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.fmi import CONTINUOUS, DISCARD, MODEL_EXCHANGE, Fmu, reals

# Inputs that are held from one time to the next: straight and turning, ahead and astern, saturated, loads, a current.
START = {"u": -0.5, "w": 0.2, "r": 1.5, "psi": 2.0}
SCHEDULE: dict[float, dict[str, float]] = {
    0.0: {"u_l": 0.3, "u_r": 0.3, "u_t": 0.4},
    2.0: {"u_l": 0.6, "u_r": -0.2, "u_t": -0.5, "N_ext": 0.05},
    4.0: {"u_l": -0.7, "u_r": 0.1, "Z_ext": 2.0},
    6.0: {"u_l": 1.4, "u_r": 0.7, "u_t": -0.9, "X_ext": -3.0, "V_N": 0.3, "V_E": -0.2},
    8.0: {},
}
STOP, INTERVAL = 10.0, 0.1


def signal(fmu: Fmu) -> NDArray[np.void]:
    """Return the schedule in the form that FMPy expects, with two rows at each jump."""
    rows = []
    for (t, held), end in zip(SCHEDULE.items(), [*list(SCHEDULE)[1:], STOP], strict=True):
        values = [held.get(name, 0.0) for name in fmu.inputs]
        rows += [(t, *values), (end, *values)]
    return np.array(rows, dtype=[(name, float) for name in ("time", *fmu.inputs)])


@pytest.fixture(scope="module")
def exact(fmu: Fmu) -> NDArray[np.float64]:
    """Return the outputs of Co-Simulation, with a row for each interval."""
    rows = []
    with fmu.instance() as rov:
        rov.start(START)
        for i in range(round(STOP / INTERVAL)):
            if (t := round(i * INTERVAL, 9)) in SCHEDULE:
                rov.set(dict.fromkeys(fmu.inputs, 0.0) | SCHEDULE[t])
            rows.append(rov.get(fmu.states))
            rov.step(i * INTERVAL, INTERVAL)
        rows.append(rov.get(fmu.states))
    return np.array(rows)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_cvode_gives_the_trajectory_of_co_simulation_within_its_tolerance(
    fmu: Fmu, exact: NDArray[np.float64], tolerance: float
) -> None:
    result = fmpy.simulate_fmu(
        str(fmu.folder),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=tolerance,
        stop_time=STOP,
        output_interval=INTERVAL,
        start_values=START,
        input=signal(fmu),
        output=fmu.states,
        record_events=False,
    )
    # The tolerance holds for one solver step; the errors of all steps add up to some hundred times as much.
    error = np.abs(np.array([result[name] for name in fmu.states]).T - exact)
    assert error.max() < 1000.0 * tolerance


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_a_solver_state_that_is_not_finite_is_discarded(fmu: Fmu, value: float) -> None:
    n = len(fmu.states)
    good = reals(*(0.125 * i for i in range(n)))
    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.reach(CONTINUOUS)
        rov.expect("SetContinuousStates", good, n)
        for i, name in enumerate(fmu.states):
            bad = reals(*[1.0] * n)
            bad[i] = value
            rov.log.clear()
            assert rov.call("SetContinuousStates", bad, n) == DISCARD
            (message,) = rov.log
            assert (message.status, message.category) == (DISCARD, "logStatusDiscard")
            assert message.text.startswith(f"{fmu.name('SetContinuousStates')}: {name} = ")
            assert message.text.endswith(f"; it stays {good[i]:g}.")
            assert rov.get(fmu.states) == list(good)
