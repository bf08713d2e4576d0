"""A run continues with the same bits wherever its state is saved and restored."""

import ctypes
import subprocess
import sys
from ctypes import c_void_p
from pathlib import Path

import pytest

from tests import fmi3
from tests.commands import ROOT
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

# Parameters, a load, a current and a motion that differ from the start values.
DISTURBED = {"m_rov": 7.5, "gamma": 0.4, "beta_u": 0.7, "alpha_w": 1.3, "a_d_r": 0.03, "Z_ext": -1.5, "V_E": 0.25}
DISTURBED |= {"u": -0.4, "w": 0.2, "r": 0.9, "x": 10.0, "psi": 2.0}


def commands(i: int) -> dict[str, float]:
    """Return the inputs and the tuned parameter of a step in a run that turns, reverses and saturates."""
    return {
        "u_l": 0.3 * (i % 7) - 1.0,
        "u_r": 1.1 - 0.4 * (i % 5),
        "u_t": (-1.0) ** (i // 3) * 0.6,
        "N_ext": 0.1 * (i % 3),
        "beta_r": 1.0 + 0.1 * (i % 2),
    }


def run(rov: AnyInstance, first: int, last: int) -> bytes:
    """Return all outputs after each step from `first` to before `last`."""
    return rov.trajectory(range(first, last), 0.05, commands)


def midway(rov: AnyInstance) -> bytes:
    """Take the first ten steps of a new instance, and return its state."""
    rov.start(DISTURBED, stop=1.0)
    run(rov, 0, 10)
    return rov.save()


@pytest.fixture(scope="module")
def whole(fmu: Fmu) -> bytes:
    """Return the outputs of 20 steps without interruption."""
    with fmu.instance() as rov:
        rov.start(DISTURBED, stop=1.0)
        result = run(rov, 0, 20)
    assert len({result[i : i + 8] for i in range(0, len(result), 8)}) > 100
    return result


def half(whole: bytes) -> bytes:
    return whole[len(whole) // 2 :]


def test_a_state_restored_in_its_own_run_repeats_it(fmu: Fmu, whole: bytes) -> None:
    state = c_void_p()
    with fmu.instance() as rov:
        midway(rov)
        rov.expect("GetFMUState", ctypes.byref(state))
        for _ in range(3):
            assert run(rov, 10, 20) == half(whole)
            rov.expect("SetFMUState", state)
        rov.expect("FreeFMUState", ctypes.byref(state))
        assert state.value is None


_ELSEWHERE = """
import sys; from pathlib import Path; from tests.fmu.calls.conftest import WRAPPERS
from tests.fmu.calls.test_state import run
with WRAPPERS[int(sys.argv[3])](Path(sys.argv[1])).instance(name='elsewhere') as rov:
    rov.load(Path(sys.argv[2]).read_bytes())
    sys.stdout.write(run(rov, 10, 20).hex())
"""


def test_a_run_continues_in_another_process(fmu: Fmu, whole: bytes, tmp_path: Path) -> None:
    saved = tmp_path / "state"
    with fmu.instance() as rov:
        saved.write_bytes(midway(rov))
    command = [sys.executable, "-c", _ELSEWHERE, str(fmu.folder), str(saved), str(fmu.VERSION)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert bytes.fromhex(result.stdout) == half(whole)


def test_instances_that_step_in_turns_give_the_same_bits_as_alone(fmu: Fmu, whole: bytes) -> None:
    with fmu.instance(name="alone") as alone:
        alone.start()
        other = run(alone, 0, 20)
    with fmu.instance(name="a") as a, fmu.instance(name="b") as b, fmu.instance(MODEL_EXCHANGE, name="c") as c:
        a.start(DISTURBED, stop=1.0)
        b.start()
        c.start({"u": -3.0})
        together = [(run(a, i, i + 1), c.set(commands(i)), run(b, i, i + 1)) for i in range(20)]
    assert b"".join(row[0] for row in together) == whole
    assert b"".join(row[2] for row in together) == other


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


def test_a_state_holds_every_value_and_the_time(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        saved, before = midway(rov), rov.get(list(fmu.variables))
        rov.expect("Reset")
        rov.start({"u_l": 0.1, "b_t_top": 3.0, "y": -4.0}, stop=50.0, at=40.0)
        rov.step(40.0, 1.0)
        rov.load(saved)
        assert rov.get(list(fmu.variables)) == before
        assert rov.time() == pytest.approx(0.5, abs=1e-15)
        rov.step(0.5, 0.6, ERROR)  # past its stop time


def test_a_state_between_steps_can_be_restored_with_event_mode_and_without(fmu3: fmi3.Fmu) -> None:
    with fmu3.instance() as plain, fmu3.instance(WITH_EVENTS) as events:
        plain.start(DISTURBED)
        events.reach(STEP)
        plain.set({name: value for name, value in commands(0).items() if name in fmu3.inputs})
        events.load(plain.save())
        assert events.mode() == STEP
        for rov in (plain, events):
            rov.step(0.0, 0.3)
        assert events.get(fmu3.states) == plain.get(fmu3.states)
        plain.load(events.save())


# ---- States that are refused ----


def assert_foreign(rov: AnyInstance, other: AnyInstance, reason: str) -> None:
    """Assert that another instance refuses the state of an instance, in memory and as bytes, and does not change."""
    state, before = c_void_p(), other.save()
    rov.expect("GetFMUState", ctypes.byref(state))
    other.refuse("SetFMUState", state)
    assert other.log
    other.load(rov.save(), ERROR)
    assert reason in other.log[-1].text
    assert other.save() == before
    rov.expect("FreeFMUState", ctypes.byref(state))


def test_a_state_in_event_mode_is_refused_by_an_instance_without_event_mode(fmu3: fmi3.Fmu) -> None:
    with fmu3.instance(WITH_EVENTS) as rov, fmu3.instance() as other:
        rov.reach(EVENT)
        assert_foreign(rov, other, "Event Mode")


def test_a_state_of_the_other_version_is_refused(fmus: dict[int, Fmu]) -> None:
    """A state names its version of FMI, both in memory and as bytes."""
    for version, fmu in fmus.items():
        with fmu.instance() as rov, fmus[5 - version].instance() as other:
            assert_foreign(rov, other, "not a state of this FMU")


@pytest.mark.parametrize(("kind", "mode"), [(CO_SIMULATION, STEP), (MODEL_EXCHANGE, CONTINUOUS)])
def test_a_state_of_the_other_interface_is_refused(fmu: Fmu, kind: int, mode: str) -> None:
    with fmu.instance(kind) as rov, fmu.instance(1 - kind) as other:
        rov.reach(mode)
        assert_foreign(rov, other, "interface")
