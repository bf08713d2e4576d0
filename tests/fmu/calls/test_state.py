"""A run continues with the same bits wherever its state is saved and restored."""

import ctypes
import struct
from ctypes import c_void_p

import pytest

from tests import fmi3
from tests.fmi import (
    CO_SIMULATION,
    CONTINUOUS,
    ERROR,
    EVENT,
    EVERY_MODE,
    MODEL_EXCHANGE,
    STEP,
    WITH_EVENTS,
    AnyInstance,
    Fmu,
)
from tests.fmu.calls.conftest import WRAPPERS
from tests.fmu.calls.test_derivatives import given


@pytest.fixture(scope="module", params=["videoray_dir", "videoray3_dir", "thrust3_dir", "outside3_dir"])
def fmu(request: pytest.FixtureRequest) -> Fmu:
    """Return the FMU of the VideoRay, of a vehicle with a dead time, or of one with six axes that counts turns."""
    return WRAPPERS[3 if "3" in request.param else 2](request.getfixturevalue(request.param))


def disturbed(fmu: Fmu) -> dict[str, float]:
    """Return parameters and a motion that differ from the start values."""
    motion = {name: 0.3 * (-1.0) ** n for n, name in enumerate(given(fmu))}
    numbers = {name: 0.95 * (float(fmu.variables[name].start) or 0.3) for name in fmu.parameters}
    return numbers | motion | {"V_E": 0.25, "r": 3.0}


def inputs(fmu: Fmu, i: int) -> dict[str, float]:
    """Return the commands, a load and a tuned parameter of a step in a run that turns and reverses."""
    found = {"N_ext": 0.1 * (i % 3), "beta_r": 1.0 + 0.1 * (i % 2)}
    for n, name in enumerate(fmu.commands):
        low, high = fmu.bounds(name)
        found[name] = low + (high - low) * ((7 * n + 3 * i) % 17) / 16.0
    return found


def run(rov: AnyInstance, first: int, last: int) -> bytes:
    """Return all outputs after each step from `first` to before `last`."""
    return rov.trajectory(range(first, last), 0.05, lambda i: inputs(rov.fmu, i))


def midway(rov: AnyInstance) -> bytes:
    """Take the first ten steps of a new instance, and return its state."""
    rov.start(disturbed(rov.fmu), stop=1.0)
    run(rov, 0, 10)
    return rov.save()


def test_a_state_restored_in_its_own_run_or_in_another_instance_repeats_the_run(fmu: Fmu) -> None:
    state = c_void_p()
    with fmu.instance() as rov, fmu.instance() as other:
        saved, values = midway(rov), rov.get(list(fmu.variables))
        rov.expect("GetFMUState", ctypes.byref(state))
        rest = run(rov, 10, 20)
        assert len(set(struct.unpack(f"{len(rest) // 8}d", rest))) > 100
        rov.expect("SetFMUState", state)
        rov.expect("FreeFMUState", ctypes.byref(state))
        assert state.value is None
        other.start({"y": -4.0}, stop=50.0, at=40.0)
        other.load(saved)
        for one in (rov, other):
            assert one.get(list(fmu.variables)) == values
            assert one.time() == pytest.approx(0.5, abs=1e-15)
            assert one.save() == saved
            assert run(one, 10, 20) == rest
            one.step(1.0, 0.6, ERROR)  # past its stop time


# ---- The content of a state ----


@pytest.mark.parametrize(("kind", "mode"), fmi3.EVERY_MODE)
def test_a_state_holds_the_mode(fmus: dict[int, Fmu], kind: int, mode: str) -> None:
    for fmu in fmus.values():
        if fmu.VERSION == 2 and (kind, mode) not in EVERY_MODE:
            continue
        with fmu.instance(kind) as rov, fmu.instance(kind) as another:
            rov.reach(mode)
            for before in (None, fmi3.MODES[kind][2]):
                if before:
                    another.expect("Reset")
                    another.reach(before)
                another.load(rov.save())
                assert another.mode() == mode
                assert another.save() == rov.save()


def test_a_state_between_steps_can_be_restored_with_event_mode_and_without(fmu3: fmi3.Fmu) -> None:
    with fmu3.instance() as plain, fmu3.instance(WITH_EVENTS) as events:
        plain.start(disturbed(fmu3))
        events.reach(STEP)
        events.load(plain.save())
        assert events.mode() == STEP
        for rov in (plain, events):
            rov.step(0.0, 0.3)
        assert events.get(fmu3.states) == plain.get(fmu3.states)
        plain.load(events.save())


@pytest.mark.parametrize(
    ("saved", "mode", "refusing", "reason"),
    [
        ((2, CO_SIMULATION), STEP, (3, CO_SIMULATION), "not a state of this FMU"),
        ((3, CO_SIMULATION), STEP, (2, CO_SIMULATION), "not a state of this FMU"),
        ((3, CO_SIMULATION), STEP, (3, MODEL_EXCHANGE), "interface"),
        ((2, MODEL_EXCHANGE), CONTINUOUS, (2, CO_SIMULATION), "interface"),
        ((3, WITH_EVENTS), EVENT, (3, CO_SIMULATION), "Event Mode"),
    ],
)
def test_a_state_of_another_version_or_interface_is_refused_in_memory_and_as_bytes(
    fmus: dict[int, Fmu], saved: tuple[int, int], mode: str, refusing: tuple[int, int], reason: str
) -> None:
    state = c_void_p()
    with fmus[saved[0]].instance(saved[1]) as rov, fmus[refusing[0]].instance(refusing[1]) as other:
        rov.reach(mode)
        before = other.save()
        rov.expect("GetFMUState", ctypes.byref(state))
        other.refuse("SetFMUState", state)
        assert other.log
        other.load(rov.save(), ERROR)
        assert reason in other.log[-1].text
        assert other.save() == before
        rov.expect("FreeFMUState", ctypes.byref(state))
