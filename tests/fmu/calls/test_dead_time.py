"""The dead time in the FMU: changes of commands wait in the saved state, and arrive as events in Model Exchange."""

import ctypes
import random
import struct
from ctypes import c_bool, c_double, c_int, pointer
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, nan

import numpy as np
import pytest
from fmpy.fmi2 import fmi2EventInfo
from lxml import etree

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.python.step import MOST_WAITING
from tests import fmi3
from tests.equation.thrust.test_thrust_effects import ROV
from tests.fmi import CONTINUOUS, ERROR, EVENT, MODEL_EXCHANGE, WARNING, WITH_EVENTS, AnyInstance, Fmu, reals
from tests.fmu.calls.conftest import modes_of, of_both_versions
from tests.fmu.calls.test_state_bytes import checksum
from tests.often import spread

T_d = ROV["T_d"]
ALL_ON = dict.fromkeys(ROV.layout.commands, 0.5)
DELAYED = {f"delayed_{name}": value for name, value in ALL_ON.items()}


fmu = of_both_versions("thrust_dir", "thrust3_dir", is_two_weekly=True)


def delayed(rov: AnyInstance) -> dict[str, float]:
    """Return the commands that act."""
    return dict(zip(DELAYED, rov.get(list(DELAYED)), strict=True))


def updated(rov: AnyInstance) -> float | None:
    """Update the discrete states, and return the time of the next event, if there is one."""
    if rov.fmu.VERSION == 2:
        info = fmi2EventInfo()
        rov.expect("UpdateDiscreteStates", ctypes.byref(info))
        return float(info.nextEventTime) if info.nextEventTimeDefined else None
    flags, next_time = [pointer(c_bool()) for _ in range(5)], pointer(c_double())
    rov.expect("UpdateDiscreteStates", *flags, next_time)
    assert not any(flag[0] for flag in flags[:4])
    return next_time[0] if flags[4][0] else None


def test_commands_change_only_in_events_and_no_rate_depends_on_them(fmu: Fmu) -> None:
    for name in ROV.layout.commands:
        command, acting = fmu.variables[name], fmu.variables[f"delayed_{name}"]
        assert (command.causality, command.variability) == ("input", "discrete")
        assert (acting.causality, acting.variability, acting.initial) == ("local", "discrete", "calculated")
    unknowns = [*fmu.description.outputs, *fmu.description.derivatives]
    known = {k.name for unknown in unknowns for k in unknown.dependencies}
    assert known.isdisjoint(ROV.layout.commands)
    assert {"X_ext", "voltage"} <= known
    if fmu.VERSION == 3:  # FMI 3.0.1, section 2.4.7: only continuous-time variables
        root = etree.parse(fmu.folder / "modelDescription.xml").getroot()
        assert root.find("ModelExchange").get("needsCompletedIntegratorStep") == "true"
        updated_inside = {v.get("name") for v in root.iter("Float64") if v.get("intermediateUpdate") == "true"}
        assert updated_inside == {*fmu.inputs, *fmu.outputs} - {*ROV.layout.commands}


def test_steps_of_any_length_are_those_of_the_engine(fmu: Fmu) -> None:
    rng = random.Random(6)
    times = [0.0, *np.cumsum([rng.choice((0.01, 0.07, 0.1, 0.35)) for _ in range(60)]).tolist()]
    commands = {name: [rng.uniform(-1.0, 1.0) for _ in times] for name in ROV.layout.commands}
    expected = simulate(ROV, np.array(times), {name: np.array(row) for name, row in commands.items()}, workers=1)
    with fmu.instance() as rov:
        rov.start({name: row[0] for name, row in commands.items()})
        for n, (t, following) in enumerate(pairwise(times)):
            rov.set({name: row[n] for name, row in commands.items()})
            rov.step(t, following - t)
            assert rov.get(list(ROV.layout.state)) == expected.values[:, 0, n + 1].tolist(), n


def test_too_many_changes_are_refused_and_change_nothing(fmu: Fmu) -> None:
    h = 0.5 * T_d / MOST_WAITING
    with fmu.instance() as rov:
        rov.start()
        for n in range(MOST_WAITING):
            rov.set({"u_l": float(1 - n % 2)})
            rov.step(n * h, h)
        rov.set({"u_l": 0.5})
        before = rov.save()
        rov.step(MOST_WAITING * h, h, ERROR)
        assert "too many changes of commands wait for the dead time" in rov.log[-1].text
        assert rov.save() == before
        rov.set({"u_l": 0.0})  # the last command that was sent
        rov.step(MOST_WAITING * h, T_d)


def test_a_state_with_waiting_commands_that_no_run_can_have_is_refused(fmu: Fmu) -> None:
    width = 2 + len(ROV.layout.commands)  # the remaining time of a change, its rounding error, and the commands
    with fmu.instance() as rov:
        rov.start()
        for n in range(2):
            rov.set({"u_l": 0.5 + 0.25 * n})
            rov.step(0.01 * n, 0.01)
        good = rov.save()
        line = len(good) - 8 * (2 + MOST_WAITING * width)

        def with_word(place: int, value: float | int) -> bytes:
            content = bytearray(good[:-8])
            struct.pack_into("<Q" if isinstance(value, int) else "<d", content, line + 8 * place, value)
            return bytes(content) + checksum(bytes(content))

        assert with_word(0, 2) == good
        for place in (1, 2, 3, width, 1 + width, 2 * width):
            for value in (nan, inf):
                rov.load(with_word(place, value), ERROR)
        rov.load(with_word(0, MOST_WAITING + 1), ERROR)
        rov.load(with_word(1, T_d), ERROR)  # the second change cannot arrive before the first
        for place, value in ((0, 1), (1, 0.0), (1 + width, T_d)):
            rov.load(with_word(place, value))
        assert rov.save() == with_word(1 + width, T_d)
    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.reach(CONTINUOUS)
        rov.set(ALL_ON)
        assert completed(rov)
        for time in (1.7e308, -1.7e308):  # their difference overflows
            rov.expect("SetTime", time)
            rov.load(rov.save())


def test_a_voltage_beyond_the_tables_is_told_once_for_their_curve(fmu: Fmu) -> None:
    for voltage, end in ((11.9, 12), (16.5, 16)):
        with fmu.instance() as rov:
            rov.set({"voltage": 12.0})
            rov.set({"voltage": 16.0})
            assert rov.log == []
            rov.set({"voltage": voltage})
            rov.set({"voltage": voltage})
            (message,) = rov.log
            told = f"voltage = {voltage:g} saturates at {end} for the thrust curve main; logged once."
            assert message.text.endswith(told)


def completed(rov: AnyInstance) -> bool:
    """Complete a step of an integrator, and return True when Event Mode has to follow."""
    kind = c_int if rov.fmu.VERSION == 2 else c_bool
    event, end = kind(-1), kind(-1)
    rov.expect("CompletedIntegratorStep", 1, pointer(event), pointer(end))
    assert not end.value
    return bool(event.value)


@dataclass
class Commands:
    """What a vehicle with a dead time does with commands in Model Exchange, written out separately."""

    set_now: dict[str, float]
    acting: dict[str, float]
    sent: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    """The commands that have not arrived, with the time at which each arrives."""

    def send(self, t: float) -> bool:
        """Send the commands that stand at a time, if they differ from those sent before."""
        if self.set_now == self.last:
            return False
        self.sent = [*(at for at in self.sent if at[0] < t + T_d), (t + T_d, dict(self.set_now))]
        return True

    @property
    def last(self) -> dict[str, float]:
        return self.sent[-1][1] if self.sent else self.acting

    def update(self, t: float) -> None:
        """An event: commands are sent, and others arrive."""
        self.send(t)
        for arrival, commands in list(self.sent):
            if arrival <= t:
                self.acting, self.sent = commands, self.sent[1:]


@pytest.mark.parametrize("seed", spread(range(10), [0], [1, 2]))
def test_only_commands_that_stand_when_a_step_is_complete_are_sent(fmu: Fmu, seed: int) -> None:
    """A solver tries steps, rejects some, completes others, and goes back to events inside them."""
    rng = random.Random(seed)
    rest = dict.fromkeys(ROV.layout.commands, 0.0)
    expected = Commands(dict(rest), dict(rest))

    def put() -> None:
        chosen = {name: rng.choice((0.0, 0.5, rng.uniform(-1.0, 1.0))) for name in rng.sample(list(rest), 2)}
        rov.set(chosen)
        expected.set_now |= chosen

    def check() -> None:
        assert list(delayed(rov).values()) == list(expected.acting.values())
        assert rov.get(list(rest)) == list(expected.set_now.values())

    def event(t: float) -> None:
        rov.expect("EnterEventMode")
        expected.set_now = dict(expected.last)
        check()
        for _ in range(rng.choice((1, 1, 2))):
            if rng.random() < 0.3:
                put()
            following = updated(rov)
            expected.update(t)
            assert following == (pytest.approx(expected.sent[0][0], rel=1e-12) if expected.sent else None)
            check()
        rov.expect("EnterContinuousTimeMode")

    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.initialize()
        rov.expect("ExitInitializationMode")
        assert updated(rov) is None
        rov.expect("EnterContinuousTimeMode")
        begin = 0.0
        for n in range(150):
            for tried in range(rng.choice((1, 1, 2, 4))):  # only the last step is not rejected
                t = begin + (0.5**tried) * rng.uniform(1e-3, 0.06)
                rov.expect("SetTime", t)
                while rng.random() < 0.6:
                    put()
                check()
            if rng.random() < 0.1:  # an event before the step is complete
                t = begin
                rov.expect("SetTime", t)
                event(t)
                continue
            due = bool(expected.sent) and expected.sent[0][0] <= t
            assert completed(rov) == (expected.send(t) or due), n
            check()
            if rng.random() < 0.1:
                rov.load(rov.save())
            if rng.random() < 0.3:
                t = rng.choice((t, rng.uniform(begin, t)))
                rov.expect("SetTime", t)
                event(t)
            begin = t
        warnings = [m for m in rov.log if m.status == WARNING]
        assert sum("is sent when the integrator completes its step" in m.text for m in warnings) == 1


def test_no_derivative_by_a_command_or_of_a_command_that_acts(fmu: Fmu) -> None:
    with fmu.instance(MODEL_EXCHANGE) as rov:
        rov.set(ALL_ON)
        rov.reach(CONTINUOUS)
        rov.set({"delayed_u_l": 0.3}, ERROR)
        unknowns = ["der(u)", "der(F_l)", "F_bow"]
        assert rov.derivatives(unknowns, "u_l") == [0.0] * 3
        assert rov.derivatives(unknowns, "X_ext")[0] > 0.0
        arguments = (fmu.references(["der(u)"]), 1, fmu.references(["delayed_u_l"]), 1)
        sizes = () if fmu.VERSION == 2 else (1,)
        rov.refuse("GetDirectionalDerivative", *arguments, reals(1.0), *sizes, reals(0.0), *sizes)
    for kind, mode in modes_of(fmu.VERSION):
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            for value in (0.0, 0.3):  # it has the first one already
                rov.set({"delayed_u_l": value}, ERROR)
            rov.refuse("GetDirectionalDerivative", *arguments, reals(1.0), *sizes, reals(0.0), *sizes)


def test_in_co_simulation_commands_are_sent_by_steps_and_set_between_them(fmu: Fmu) -> None:
    if not isinstance(fmu, fmi3.Fmu):
        return  # FMI 2.0 has neither events nor updates there

    def act(rov: fmi3.Instance, _: fmi3.Update) -> None:
        rov.set({"u_l": 0.7}, ERROR)
        rov.set({"X_ext": 1.0})

    with fmu.instance(WITH_EVENTS, intermediate=["X_ext"], on_update=act) as rov:
        rov.reach(EVENT)
        rov.set(ALL_ON)
        assert updated(rov) is None
        rov.expect("EnterStepMode")
        rov.step(0.0, 1.5 * T_d)
        assert delayed(rov) == DELAYED
        assert rov.get(["X_ext", "u_l"]) == [1.0, 0.5]
