"""An instance of either version of FMI is created, or refused with one log line that gives the reason."""

import ctypes
from typing import Any

import pytest
from fmpy.fmi2 import fmi2CallbackFunctions
from fmpy.fmi3 import fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from tests import fmi2, fmi3
from tests.fmi import CO_SIMULATION, ERROR, MODEL_EXCHANGE, Fmu, Message, references

CS, ME = CO_SIMULATION, MODEL_EXCHANGE
OWN = object()
"""This stands for the GUID of the FMU."""
OTHER = b"{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"


def instantiate(
    fmu: Fmu, kind: int, name: bytes | None, token: Any, log: list[Message] | None, logging: bool = True, vr: Any = ()
) -> Any:
    """Return a new instance, or None. Without a log, there is no logger."""
    token = fmu.token if token is OWN else token
    if fmu.VERSION == 2:
        callbacks = fmi2CallbackFunctions() if log is None else fmi2.recording_callbacks(log)
        return fmu.dll.fmi2Instantiate(name, kind, token, None, ctypes.byref(callbacks), 0, logging)
    logger = fmi3LogMessageCallback() if log is None else fmi3.recorder(log)
    arguments = (name, token, None, False, logging)
    if kind == ME:
        return fmu.dll.fmi3InstantiateModelExchange(*arguments, None, logger)
    update, n = fmi3IntermediateUpdateCallback(), 1 if vr is None else len(vr)
    return fmu.dll.fmi3InstantiateCoSimulation(*arguments, False, False, vr or None, n, None, logger, update)


def assert_refused(fmu: Fmu, kind: int, name: bytes | None, token: Any, reason: str, vr: Any = ()) -> None:
    """Assert that there is no instance, and one log line. FMI 2.0 logs it even if logging is off."""
    log: list[Message] = []
    for logging in (True, False):
        assert instantiate(fmu, kind, name, token, log, logging, vr) is None
        assert instantiate(fmu, kind, name, token, None, logging, vr) is None
    assert len(log) == (2 if fmu.VERSION == 2 else 1)
    function = "fmi3InstantiateModelExchange" if kind == ME else "fmi3InstantiateCoSimulation"
    for message in log:
        assert (message.status, message.category) == (ERROR, "logStatusError")
        assert message.text.startswith("fmi2Instantiate: " if fmu.VERSION == 2 else f"{function}: ")
        assert reason in message.text


@pytest.mark.parametrize("kind", [CS, ME])
@pytest.mark.parametrize(
    ("name", "token", "reason"),
    [
        (None, OWN, "name"),
        (b"", OWN, "name"),
        (b" \t\r\n", OWN, "name"),
        (b"rov", None, "NULL"),
        (b"rov", b"", ""),
        (b"rov", OTHER, OTHER.decode()),
        (b"rov", b"%n" * 300, "%n"),
    ],
)
def test_a_bad_instantiation_gives_no_instance_and_one_log_line(
    fmu: Fmu, kind: int, name: bytes | None, token: Any, reason: str
) -> None:
    assert_refused(fmu, kind, name, token, reason)


@pytest.mark.parametrize("kind", [2, -1])
def test_a_kind_that_fmi_2_does_not_have_is_refused(fmu2: fmi2.Fmu, kind: int) -> None:
    assert_refused(fmu2, kind, b"rov", OWN, f"fmuType = {kind}")


def test_no_callbacks_give_no_instance(fmu2: fmi2.Fmu) -> None:
    assert fmu2.dll.fmi2Instantiate(b"rov", CS, fmu2.token, None, None, 0, 0) is None


def test_variables_of_intermediate_update_must_be_variables_of_the_fmu(fmu3: fmi3.Fmu) -> None:
    n = len(fmu3.variables)  # references are 1 to n
    for vr in (references(1, n + 1), references(0), None):
        assert_refused(fmu3, CS, b"rov", OWN, "requiredIntermediateVariables", vr)
