"""Event Mode of FMI 3.0 in both interfaces: the model has no events, the importer tunes parameters and sets states."""

import pytest

from tests.fmi import CO_SIMULATION, EVENT, MODEL_EXCHANGE, STEP, WARNING, WITH_EVENTS, room
from tests.fmi3 import Fmu, flags

MOVING = {"u_l": 0.6, "u_r": 0.2, "u_t": -0.4, "u": 0.3, "r": -0.5, "V_E": 0.1}
CHANGES = {"beta_u": 0.7, "alpha_w": 1.3, "u_l": -0.5, "u": -0.2, "psi": 1.0, "N_ext": 0.05}
"""New values of tunable parameters, inputs and states."""


@pytest.mark.parametrize("kind", [MODEL_EXCHANGE, WITH_EVENTS])
def test_there_are_no_events(fmu3: Fmu, kind: int) -> None:
    with fmu3.instance(kind) as rov:
        rov.reach(EVENT)
        before = rov.save()
        for _ in range(2):
            results, next_time = [flags(True) for _ in range(5)], room()
            rov.expect("fmi3UpdateDiscreteStates", *results, next_time)
            assert [bool(flag[0]) for flag in results] == [False] * 5
            assert next_time[0] == 0.0
            rov.expect("fmi3EvaluateDiscreteStates")
        assert rov.save() == before
        if kind == MODEL_EXCHANGE:
            rov.expect("fmi3EnterContinuousTimeMode")
            enter, terminate = flags(True), flags(True)
            rov.expect("fmi3CompletedIntegratorStep", True, enter, terminate)
            assert (enter[0], terminate[0]) == (False, False)


def test_values_set_in_event_mode_hold_afterwards(fmu3: Fmu) -> None:
    """The steps after them equal those of a run that begins with these values, without Event Mode."""
    with fmu3.instance(WITH_EVENTS) as rov, fmu3.instance() as plain, fmu3.instance() as changed:
        rov.set(MOVING)
        rov.reach(STEP)
        plain.start(MOVING)
        assert rov.trajectory(range(10)) == plain.trajectory(range(10))
        end = dict(zip(fmu3.states, rov.get(fmu3.states), strict=True))
        rov.expect("EnterEventMode")
        rov.set(CHANGES)
        rov.update()
        rov.expect("EnterStepMode")
        changed.start({**MOVING, **end, **CHANGES}, at=rov.time())
        assert rov.trajectory(range(10, 20)) == changed.trajectory(range(10, 20)) != plain.trajectory(range(10, 20))
        assert rov.log == plain.log == []


@pytest.mark.parametrize("kind", [CO_SIMULATION, WITH_EVENTS])
def test_parameters_can_be_tuned_between_steps_with_a_warning_if_event_mode_is_used(fmu3: Fmu, kind: int) -> None:
    with fmu3.instance(kind) as rov, fmu3.instance() as changed:
        rov.set(MOVING)
        rov.reach(STEP)
        for value in (0.5, 0.7):
            rov.set({"beta_u": value})
        changed.start({**MOVING, "beta_u": 0.7})
        assert rov.trajectory(range(10)) == changed.trajectory(range(10))
        assert [(m.status, m.text.split()[:2]) for m in rov.log] == [(WARNING, ["fmi3SetFloat64:", "beta_u"])] * (
            kind == WITH_EVENTS
        )
