"""Intermediate update and early return: the importer reads outputs, sets inputs and ends a step during the step."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import nan, sin

import pytest

from tests import fmi3
from tests.fmi import CO_SIMULATION, ERROR, FAILED, INTERMEDIATE, STEP, WITH_EVENTS
from tests.fmi3 import Instance, Stepped, Update

PIECE = 1e-4
MOVING = {"r": -0.5, "u": 0.3, "psi": 1.0, "V_E": 0.1}
Control = Callable[[float], Mapping[str, float]]
"""A function that returns inputs for a time."""


@pytest.fixture(scope="module", params=["videoray3_dir", "everything3_dir"])
def fmu3(request: pytest.FixtureRequest) -> fmi3.Fmu:
    return fmi3.Fmu(request.getfixturevalue(request.param))


def swing(fmu3: fmi3.Fmu) -> Control:
    """Return sinusoidal commands of different frequencies."""
    return lambda t: {name: 0.8 * sin((3.0 + 2.0 * n) * t + n) for n, name in enumerate(fmu3.commands)}


def moving(
    fmu3: fmi3.Fmu, control: Control, early: bool = False, kind: int = CO_SIMULATION, **start: float
) -> Instance:
    """Return an instance in Step Mode whose inputs are set in intermediate update."""
    rov = fmu3.instance(kind, intermediate=[*fmu3.commands, *fmu3.outputs], early=early)
    rov.set(MOVING | start)
    rov.reach(STEP)
    rov.on_update = lambda rov, update: _command(rov, control(update.time))
    return rov


def _command(rov: Instance, values: Mapping[str, float]) -> None:
    rov.set(values)


def separate_steps(fmu3: fmi3.Fmu, times: list[float], control: Control) -> list[list[float]]:
    """Return the outputs at each time, computed by a step from each time to the next with the inputs set before it."""
    with fmu3.instance() as rov:
        rov.start(MOVING, at=times[0])
        found = []
        for t, end in pairwise(times):
            rov.set(control(t))
            found.append(rov.get(fmu3.outputs))
            rov.step(t, end - t)
        rov.set(control(times[-1]))
        return [*found, rov.get(fmu3.outputs)]


@pytest.mark.parametrize("early", [False, True])
@pytest.mark.parametrize("h", [0.3 * PIECE, PIECE, 1.5 * PIECE, 1e-3, 0.1, pytest.param(5.0, marks=pytest.mark.weekly)])
def test_the_callback_is_called_at_the_ends_of_a_step_and_every_tenth_of_a_millisecond(
    fmu3: fmi3.Fmu, h: float, early: bool
) -> None:
    updates: list[Update] = []
    with moving(fmu3, lambda _: {}, early) as rov:
        rov.on_update = lambda _, update: updates.append(update)
        rov.step(0.5, h)
        assert rov.stepped == Stepped(False, False, False, 0.5 + h)
        assert rov.time() == 0.5 + h
    times = [update.time for update in updates]
    pieces = len(updates) - 1
    assert pieces == min(10_000, max(1, round(h / PIECE + 0.49)))
    assert times == pytest.approx([0.5 + h * n / pieces for n in range(pieces + 1)], rel=1e-15)
    assert (times[0], times[-1]) == (0.5, 0.5 + h)
    assert [update.can_return_early for update in updates] == [early and 0 < n < pieces for n in range(pieces + 1)]
    assert all(update[1:4] == (True, True, True) for update in updates)


@pytest.mark.parametrize("kind", [CO_SIMULATION, WITH_EVENTS])
def test_inputs_set_inside_are_held_from_then_on_and_outputs_are_those_of_that_time(fmu3: fmi3.Fmu, kind: int) -> None:
    """The results equal those of separate steps from one callback to the next."""
    control, seen = swing(fmu3), dict[float, list[float]]()

    def act(rov: Instance, update: Update) -> None:
        _command(rov, control(update.time))
        seen[update.time] = rov.get(fmu3.outputs)
        assert rov.get(["time"]) == [update.time]
        assert rov.rates(["u"]) == pytest.approx(rov.get(["der(u)"]), rel=1e-13)
        assert rov.mode() == INTERMEDIATE

    with moving(fmu3, control, kind=kind) as rov:
        rov.on_update = act
        rov.step(0.0, 0.01)
        first = len(seen)
        for n in (1, 2):
            rov.step(0.01 * n, 0.01)
        assert rov.mode() == STEP
        assert rov.log == []
        assert rov.get(fmu3.outputs) == seen[0.01 * 2 + 0.01]
    expected = separate_steps(fmu3, list(seen), control)
    assert (first, len(seen)) == (101, 301)
    assert list(seen.values())[:first] == expected[:first]  # to the bit; later times have rounding errors
    for outputs, reference in zip(seen.values(), expected, strict=True):
        assert outputs == pytest.approx(reference, rel=1e-12, abs=1e-13)


def test_only_inputs_can_be_set_inside_a_step(fmu3: fmi3.Fmu) -> None:
    control = swing(fmu3)

    def act(rov: Instance, update: Update) -> None:
        for name in ("beta_u", "m_rov", "u", "F_0_w", "time"):
            if name in fmu3.vr:
                rov.set({fmu3.commands[0]: 1.0, name: 0.5}, ERROR)
        rov.step(update.time, 0.1, ERROR)  # a step inside a step is refused
        assert all(m.status == ERROR for m in rov.log)
        _command(rov, control(update.time))

    with moving(fmu3, control) as rov, moving(fmu3, control) as other:
        rov.on_update = act
        for each in (rov, other):
            each.step(0.0, 0.002)
        assert rov.get(list(fmu3.variables)) == other.get(list(fmu3.variables))


# ---- Early return ----


@pytest.mark.parametrize(
    ("requested", "end"),
    [
        (0.00137, 0.00137),
        (0.0002, 0.0005),  # in the past, so the step ends at once
        (1.0, 0.01),
        (nan, 0.01),
    ],
)
def test_a_step_ends_at_the_requested_time(fmu3: fmi3.Fmu, requested: float, end: float) -> None:
    control = swing(fmu3)
    times: list[float] = []

    def act(rov: Instance, update: Update) -> float | None:
        times.append(update.time)
        _command(rov, control(update.time))
        return requested if len(times) == 6 else None

    with moving(fmu3, control, early=True) as rov:
        rov.on_update = act
        rov.step(0.0, 0.01)
        assert times[5] == 0.0005
        assert rov.stepped == Stepped(False, False, end < 0.01, end)
        assert times[-1] == rov.time() == end
        rov.step(end, 0.01)  # and the next step continues from there
        assert rov.log == []
        assert times.count(end) == 2
        outputs = rov.get(fmu3.outputs)
    assert outputs == pytest.approx(separate_steps(fmu3, sorted(set(times)), control)[-1], rel=1e-12, abs=1e-13)


def test_a_step_that_fails_inside_returns_the_last_successful_time(fmu3: fmi3.Fmu) -> None:
    def act(rov: Instance, update: Update) -> None:
        if update.time > 0.00249:
            rov.set({"beta_u": 0.5}, ERROR)
            _command(rov, {"V_N": 1e308})

    with moving(fmu3, swing(fmu3), x=1.7976e308) as rov:
        rov.on_update = act
        rov.step(0.0, 0.01, ERROR)
        assert rov.stepped == Stepped(False, False, False, 0.0025)
        assert rov.time() == 0.0025
        assert rov.mode() == FAILED
        assert [m.text.partition(":")[0] for m in rov.log] == ["fmi3SetFloat64", "fmi3DoStep"]
