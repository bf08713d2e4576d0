"""The attitude of a vehicle with six axes in the FMU: its parameters, the quaternion, and the count of turns."""

import random
from ctypes import c_bool, c_int, pointer
from itertools import pairwise
from math import cos, pi, sin

import pytest

from tests.fmi import (
    CONTINUOUS,
    DISCARD,
    ERROR,
    EVENT,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    STEP,
    WARNING,
    AnyInstance,
    Fmu,
    reals,
    room,
)
from tests.fmu.calls.conftest import modes_of, of_both_versions
from tests.vehicles import SIX, random_inputs, random_state
from verification.references.rigid_vehicle import QUATERNION

ANGLES = ("phi", "theta", "psi")
START = {"phi_0": 0.3, "theta_0": -0.8, "psi_0": 8.0}


fmu = of_both_versions("six_dir", "outside3_dir", is_two_weekly=True)


def complete(rov: AnyInstance, status: int = OK) -> None:
    """Complete a step of an integrator."""
    kind = c_int if rov.fmu.VERSION == 2 else c_bool
    rov.expect("CompletedIntegratorStep", 1, pointer(kind()), pointer(kind()), status=status)


def put(rov: AnyInstance, state: dict[str, float], status: int = OK) -> None:
    """Set all states as a solver does."""
    values = reals(*(state[name] for name in rov.fmu.states))
    rov.expect("SetContinuousStates", values, len(values), status=status)


def states(rov: AnyInstance) -> dict[str, float]:
    return dict(zip(rov.fmu.states, rov.get(rov.fmu.states), strict=True))


def heading(psi: float) -> dict[str, float]:
    """Return the quaternion of a level vehicle."""
    return {"eta": cos(0.5 * psi), "epsilon_1": 0.0, "epsilon_2": 0.0, "epsilon_3": sin(0.5 * psi)}


def test_the_attitude_begins_at_its_parameters(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        assert rov.get(QUATERNION) == [1.0, 0.0, 0.0, 0.0]
        rov.set(START)
        assert rov.get(ANGLES) == pytest.approx([*START.values()], abs=1e-15)
        rov.set({"psi_0": -9.0})
        rov.reach(STEP)
        assert rov.get(ANGLES) == pytest.approx([0.3, -0.8, -9.0], abs=1e-15)
        rov.expect("Reset")
        assert rov.get(ANGLES) == [0.0, 0.0, 0.0]


def test_a_quaternion_before_the_start_is_a_guess_that_the_angles_replace(fmu: Fmu) -> None:
    variables = [fmu.variables[name] for name in QUATERNION]
    assert [(v.causality, v.initial, float(v.start)) for v in variables] == [
        ("output", "approx", start) for start in (1.0, 0.0, 0.0, 0.0)
    ]
    assert {*QUATERNION} <= {unknown.variable.name for unknown in fmu.description.initialUnknowns}
    with fmu.instance() as rov, fmu.instance() as usual:
        for _ in range(2):  # again after a reset
            rov.set(dict.fromkeys(QUATERNION, 0.0))  # by CasADi
            rov.set({**START, "eta": 0.5})
            rov.set({"epsilon_2": 2.0})
            (warning,) = [m.text for m in rov.log if m.status == WARNING]
            assert "eta = 0 is replaced by 1, because phi_0, theta_0 and psi_0 determine" in warning
            rov.set({"eta": float("nan")}, DISCARD)
            usual.set(START)
            assert rov.save() == usual.save()
            for instance in (rov, usual):
                instance.reach(STEP)
            assert rov.save() == usual.save()
            assert rov.get(ANGLES) == pytest.approx([*START.values()], abs=1e-15)
            for instance in (rov, usual):
                instance.expect("Reset")
                instance.log.clear()


def test_a_quaternion_is_set_by_solvers_and_in_events_only(fmu: Fmu) -> None:
    for kind, mode in modes_of(fmu.VERSION):
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            is_taken = mode == CONTINUOUS or (mode == EVENT and fmu.VERSION == 3)
            rov.set({"eta": 0.5}, OK if is_taken or mode == INSTANTIATED else ERROR)
            assert rov.get(["eta"]) == [0.5 if is_taken else 1.0], mode


def test_steps_count_the_turns(fmu: Fmu) -> None:
    """A torque turns the vehicle several times, by less than half a turn in each step; psi never falls."""
    with fmu.instance() as rov:
        rov.start({"N_ext": 5.0})
        headings = [0.0]
        for n in range(60):
            rov.step(0.5 * n, 0.5)
            headings += rov.get(["psi"])
    turns = [after - before for before, after in pairwise(headings)]
    assert 0.0 < min(turns) < max(turns) < pi
    assert headings[-1] > 4.0 * pi


# ---- Model Exchange ----


def test_turns_are_counted_only_when_an_integrator_completes_a_step(fmu: Fmu) -> None:
    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.set({"psi_0": 3.0})
        rov.reach(CONTINUOUS)
        at = states(rov)
        for psi in (4.0, 5.0, 6.0, 3.0):  # tried by a solver
            put(rov, at | heading(psi))
            assert rov.get(["psi"]) == pytest.approx([psi], abs=1e-14)
        put(rov, at | heading(6.5))
        assert rov.get(["psi"]) == pytest.approx([6.5 - 2.0 * pi], abs=1e-14)  # more than half a turn from 3
        for psi in (5.0, 7.0, 9.0, 11.0, 20.0 - 2.0 * pi):
            put(rov, at | heading(psi))
            complete(rov)
            assert rov.get(["psi"]) == pytest.approx([psi], abs=1e-14)


@pytest.mark.parametrize("length", [1e-100, 0.3, 1.7, 1e100])
def test_a_quaternion_may_have_any_length(fmu: Fmu, length: float) -> None:
    """The rates of the others do not depend on it, and its own are proportional to it."""
    rng = random.Random(2)
    state = random_state(rng, SIX)
    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.start(random_inputs(rng, SIX))
        rov.expect("EnterContinuousTimeMode")
        found = []
        for scale in (1.0, length):
            put(rov, {name: x * (scale if name in QUATERNION else 1.0) for name, x in state.items()})
            names = [f"der({name})" for name in fmu.states]
            found.append([*rov.get(names), *rov.get(ANGLES)])
        scales = [length if name in QUATERNION else 1.0 for name in fmu.states] + [1.0] * 3
        assert found[1] == pytest.approx([x * scale for x, scale in zip(found[0], scales, strict=True)], rel=1e-12)


def test_a_quaternion_of_zero_is_refused(fmu: Fmu) -> None:
    nothing = dict.fromkeys(QUATERNION, 0.0)
    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.reach(CONTINUOUS)
        before = states(rov)
        put(rov, before | nothing, DISCARD)
        assert rov.log[-1].text.endswith("the quaternion is 0, which has no direction; the states are not changed.")
        assert states(rov) == before
        rov.set(nothing)  # one of them after the other may be 0
        assert rov.get_by(fmu.references(["psi"]), room()) == DISCARD
        complete(rov, DISCARD)
        put(rov, before)
        assert rov.get(["psi"]) == [0.0]
        complete(rov)
