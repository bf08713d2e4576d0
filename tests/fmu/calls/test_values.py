"""Invalid values are discarded, commands beyond ±1 saturate, and the log names the variable once."""

from math import inf, nan, nextafter

import pytest

from tests import fmi3
from tests.fmi import (
    CO_SIMULATION,
    CONTINUOUS,
    DISCARD,
    ERROR,
    EVENT,
    INITIALIZATION,
    MODEL_EXCHANGE,
    OK,
    STEP,
    WARNING,
    AnyInstance,
    Fmu,
    integers,
    references,
    room,
    strings,
)

COMMANDS = ("u_l", "u_r", "u_t")


def assert_discarded(rov: AnyInstance, name: str, value: float) -> None:
    """Assert that an invalid value is discarded together with a valid one, and one log line names its variable."""
    companion = "u_l" if name != "u_l" else "u_r"
    before = rov.save()
    (kept,) = rov.get([name])
    rov.log.clear()
    rov.set({companion: 0.875, name: value}, DISCARD)
    (message,) = rov.log
    assert (message.status, message.category) == (DISCARD, "logStatusDiscard")
    assert message.text.startswith(f"{rov.fmu.name('SetFloat64')}: {name} = ")
    assert message.text.endswith(f"; it stays {kept:.15g}.")
    assert rov.save() == before


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        (CO_SIMULATION, INITIALIZATION),
        (CO_SIMULATION, STEP),
        (MODEL_EXCHANGE, INITIALIZATION),
        (MODEL_EXCHANGE, EVENT),
        (MODEL_EXCHANGE, CONTINUOUS),
    ],
)
def test_no_variable_takes_a_value_that_is_not_finite(fmu: Fmu, kind: int, mode: str) -> None:
    with fmu.instance(kind) as rov:
        rov.reach(mode)
        for name in fmu.settable(mode):
            for value in (nan, inf, -inf):
                assert_discarded(rov, name, value)


def test_a_parameter_takes_its_bounds_and_nothing_beyond(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.reach(INITIALIZATION)
        for name in fmu.parameters:
            low, high = fmu.bounds(name)
            for value in (nextafter(low, -inf), nextafter(high, inf), low - 1e300, 1e308):
                assert_discarded(rov, name, value)
            for value in (low, high):
                rov.set({name: value})
                assert rov.get([name]) == [value]


def test_values_that_overflow_are_logged_and_not_returned(fmu: Fmu) -> None:
    n = len(fmu.states)
    for kind, status in [(CO_SIMULATION, ERROR), (MODEL_EXCHANGE, DISCARD)]:
        with fmu.instance(kind) as rov:
            rov.start({"w": 1e308})
            value = room(2)
            assert rov.get_by(fmu.references(["z", "der(w)"]), value) == status
            assert list(value) == [-7.0] * 2
            values = room(n if kind == MODEL_EXCHANGE else 1)
            if kind == MODEL_EXCHANGE:
                assert rov.call("GetContinuousStateDerivatives", values, n) == status
            else:
                assert rov.rates_by(references(fmu.vr["w"]), integers(1), values) == status
            assert set(values) == {-7.0}
            assert len(rov.log) == 2
            assert all("der(w) overflows" in m.text or "derivative of w overflows" in m.text for m in rov.log)
            pairs = [(fmu.references(names), 2) for names in (("der(u)", "der(w)"), ("u", "w"))]
            for derivative in ("Directional", "Adjoint")[: fmu.VERSION - 1]:
                rov.refuse(f"Get{derivative}Derivative", *pairs[0], *pairs[1], *fmu.sized(value), *fmu.sized(value))
                assert list(value) == [-7.0] * 2
                assert "the derivative of" in rov.log[-1].text


@pytest.mark.parametrize("value", [nextafter(1.0, 2.0), 1.5, -1.5, 1e308, -1e308])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_beyond_full_saturates_and_is_logged_once(fmu: Fmu, command: str, value: float) -> None:
    moving = {"u_l": 0.5, "u_r": 0.25, "u_t": -0.5, "u": 0.3, "r": -0.2}
    with fmu.instance() as full:
        full.start(moving | {command: 1.0 if value > 0.0 else -1.0})
        assert full.log == []
        expected = full.trajectory(range(5))
    with fmu.instance() as rov:
        rov.start(moving | {command: value})
        assert rov.trajectory(range(5)) == expected
        for _ in range(3):
            rov.set({command: -value})
            rov.set({command: value})
        (message,) = rov.log
    assert (message.status, message.category) == (WARNING, "logStatusWarning")
    assert message.text.startswith(
        f"{fmu.name('SetFloat64')}: {command} = {value:.15g} saturates at {1 if value > 0.0 else -1}"
    )


def test_in_fmi_3_a_message_is_the_text_with_every_hash_doubled(fmu3: fmi3.Fmu) -> None:
    with fmu3.instance() as rov:
        rov.refuse("SetDebugLogging", 1, 1, strings(b"#50 %d%%n%##"))
        (message,) = rov.log
    assert message.text == "fmi3SetDebugLogging: there is no log category ##50 %d%%n%####."


def test_in_fmi_2_a_message_is_a_printf_format_that_gives_the_text(fmu2: Fmu) -> None:
    with fmu2.instance(name="100 %s%n") as rov:
        rov.refuse("SetDebugLogging", 1, 1, strings(b"#50 %d%%n%##"))
        (message,) = rov.log
    assert message.instance == "100 %s%n"
    assert "##50 %d%%n%####" in message.text % ()  # a single # would begin a value reference (2.1.5)


def refused(rov: AnyInstance) -> list[str]:
    """Return the categories logged for a restored state, an illegal call and a value that is not finite."""
    rov.log.clear()
    rov.load(rov.save())
    rov.refuse("ExitInitializationMode")
    rov.set({"u": nan}, DISCARD)
    return [m.category for m in rov.log]


SWITCHES: list[tuple[int, str, str]] = [
    (0, "logEvents", "logStatusError logStatusDiscard"),
    (0, "logStatusError", "logStatusDiscard"),
    (0, "", ""),
    (-1, "logStatusError logEvents", "logEvents logStatusError"),
    (0, "logStatusError logNoSuch", "logEvents logStatusError"),  # it is refused
    (1, "logStatusDiscard", "logEvents logStatusError logStatusDiscard"),
    (0, "logEvents", "logStatusError logStatusDiscard"),
    (1, "", "logEvents logStatusError logStatusDiscard"),
    (0, "logStatusError", "logEvents logStatusDiscard"),
    (0, "logAll", ""),
    (1, "logAll", "logEvents logStatusError logStatusDiscard"),
]
"""Whether categories are switched on or off, which ones, and those that are logged afterwards."""


def test_log_categories_are_switched_on_and_off(fmu: Fmu) -> None:
    every = ["logEvents", "logStatusError", "logStatusDiscard"]
    with fmu.instance(logging=True) as rov:
        assert refused(rov) == every
        for on, names, logged in SWITCHES:
            categories = strings(*(name.encode() for name in names.split()))
            status = ERROR if "NoSuch" in names else OK
            rov.expect("SetDebugLogging", on, len(categories), categories if names else None, status=status)
            assert refused(rov) == logged.split()
        rov.expect("Reset")  # restores the categories of the instantiation
        assert refused(rov) == every
        assert {c.name for c in fmu.description.logCategories} >= {*every}
