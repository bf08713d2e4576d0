"""A current that passes the vehicle in the FMU: what it was is part of the state, and Model Exchange is refused."""

import numpy as np
import pytest

from rov_fmu.c.compile import OptionError
from rov_fmu.c.simulation import simulate
from rov_fmu.interface.model import load
from tests.fmi import ERROR, Fmu
from tests.fmu.calls.conftest import of_both_versions
from tests.vehicles import HEAVY, a_vehicle, passed

ROV = a_vehicle(passed(HEAVY))
fmu = of_both_versions("passed_dir", "passed3_dir", is_two_weekly=True)
TIMES = np.linspace(0.0, 2.0, 5)
INPUTS = {
    "V_N": np.array([0.1, 0.4, 0.4, -0.3, 0.0]),
    "V_E": np.array([0.0, 0.2, -0.2, -0.2, 0.0]),
    "u_1": np.full(5, 0.3),
}


def held(n: int) -> dict[str, float]:
    """Return the inputs of a step."""
    return {name: float(row[n]) for name, row in INPUTS.items()}


@pytest.mark.parametrize("first", [{}, {"V_N": -0.7}, held(0)], ids=["set after it", "changed after it", "set in it"])
def test_steps_are_those_of_the_engine_also_from_a_saved_state(fmu: Fmu, first: dict[str, float]) -> None:
    """The current of the first step is no change, whenever the initialization ended. A state says whether it came."""
    expected, state = simulate(ROV, TIMES, INPUTS).values[:, 0], [*ROV.layout.state]
    with fmu.instance() as rov, fmu.instance() as other:
        rov.start(first)
        other.start()
        for n, t in enumerate(TIMES[:-1].tolist()):
            rov.set({"V_N": 0.33})
            other.load(rov.save())
            rov, other = other, rov  # noqa: PLW2901
            rov.set(held(n))
            assert (rov.get(["V_N_before"]) == [INPUTS["V_N"][n]]) == (
                n == 0 or INPUTS["V_N"][n] == INPUTS["V_N"][n - 1]
            )
            rov.step(t, 0.5)
            assert rov.get(state) == expected[:, n + 1].tolist(), n
            other.load(rov.save())
            rov, other = other, rov  # noqa: PLW2901


def test_a_step_that_is_refused_keeps_the_current(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start()
        rov.step(0.0, 1.0)
        rov.set({"V_N": 0.5})
        before = rov.save()
        rov.step(1.0, -1.0, ERROR)
        assert rov.save() == before
        assert rov.get(["V_N_before"]) == [0.0]


@pytest.mark.parametrize("interface", ["me", "both"])
def test_model_exchange_is_refused(interface: str) -> None:
    words = f'--interface {interface}: current = "passes": it changes velocities, which an importer'
    with pytest.raises(OptionError, match=words):
        load(ROV).build("rov.fmu", interface=interface)
