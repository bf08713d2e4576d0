"""An instance of either version of FMI is created, or refused with one log line that gives the reason."""

import ctypes
from typing import Any

import pytest
from fmpy.fmi2 import fmi2CallbackFunctions
from fmpy.fmi3 import (
    fmi3IntermediateUpdateCallback,
    fmi3LogMessageCallback,
)

from tests import fmi2, fmi3
from tests.fmi import CO_SIMULATION, ERROR, MODEL_EXCHANGE, Message, references

CS, ME = CO_SIMULATION, MODEL_EXCHANGE
GUID = object()  # stands for the GUID of the FMU


@pytest.mark.parametrize(
    ("name", "kind", "guid", "reason"),
    [
        (None, CS, GUID, "name"),
        (b"", CS, GUID, "name"),
        (b" \t\r\n", ME, GUID, "name"),
        (b"rov", 2, GUID, "fmuType = 2"),
        (b"rov", -1, GUID, "fmuType = -1"),
        (b"rov", CS, None, "NULL"),
        (b"rov", CS, b"", "GUID"),
        (b"rov", ME, b"{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}", "{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"),
        (b"rov", CS, b"%n" * 300, "GUID"),
    ],
)
def test_a_bad_instantiation_gives_no_instance_and_one_log_line(
    fmu2: fmi2.Fmu, name: bytes | None, kind: int, guid: Any, reason: str
) -> None:
    log: list[Message] = []
    callbacks = fmi2.recording_callbacks(log)
    own = fmu2.token
    component = fmu2.dll.fmi2Instantiate(name, kind, own if guid is GUID else guid, None, ctypes.byref(callbacks), 0, 0)
    assert component is None
    (message,) = log
    assert (message.status, message.category) == (ERROR, "logStatusError")
    assert message.text.startswith("fmi2Instantiate: ")
    assert reason in message.text
    silent = fmi2CallbackFunctions()  # no logger
    assert fmu2.dll.fmi2Instantiate(name, kind, own if guid is GUID else guid, None, ctypes.byref(silent), 0, 0) is None


def test_no_callbacks_give_no_instance(fmu2: fmi2.Fmu) -> None:
    assert fmu2.dll.fmi2Instantiate(b"rov", CS, fmu2.token, None, None, 0, 0) is None


# ---- FMI 3.0 ----

NO_LOGGER, NO_UPDATE = fmi3LogMessageCallback(), fmi3IntermediateUpdateCallback()


def instantiate(
    fmu3: fmi3.Fmu,
    name: bytes | None,
    token: bytes | None,
    logger: Any,
    references: Any = None,
    n: int = 0,
    logging: bool = True,
) -> Any:
    """Return a new instance of Co-Simulation without intermediate update, or None."""
    arguments = (name, token, None, False, logging, False, False, references, n, None, logger, NO_UPDATE)
    return fmu3.dll.fmi3InstantiateCoSimulation(*arguments)


@pytest.mark.parametrize(
    ("name", "token", "reason"),
    [
        (None, GUID, "name"),
        (b" \t\r\n", GUID, "name"),
        (b"rov", None, "NULL"),
        (b"rov", b"", "instantiation token"),
        (b"rov", b"{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}", "{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"),
    ],
)
def test_a_bad_instantiation_of_fmi_3_gives_no_instance(
    fmu3: fmi3.Fmu, name: bytes | None, token: Any, reason: str
) -> None:
    given = fmu3.token if token is GUID else token
    log: list[Message] = []
    for function in ("fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"):
        logger = fmi3.recorder(log)
        if function == "fmi3InstantiateCoSimulation":
            assert instantiate(fmu3, name, given, logger) is None
            assert instantiate(fmu3, name, given, logger, logging=False) is None
            assert instantiate(fmu3, name, given, NO_LOGGER) is None
        else:
            for logging, to in [(True, logger), (False, logger), (True, NO_LOGGER)]:
                assert fmu3.dll.fmi3InstantiateModelExchange(name, given, None, False, logging, None, to) is None
        (message,) = log
        assert (message.status, message.category) == (ERROR, "logStatusError")
        assert message.text.startswith(f"{function}: ")
        assert reason in message.text
        log.clear()


def test_variables_of_intermediate_update_must_be_variables_of_the_fmu(fmu3: fmi3.Fmu) -> None:
    n = len(fmu3.variables)  # references are 1 to n
    for vr, size in [(references(1, n + 1), 2), (references(0), 1), (None, 1)]:
        log: list[Message] = []
        assert instantiate(fmu3, b"rov", fmu3.token, fmi3.recorder(log), vr, size) is None
        assert instantiate(fmu3, b"rov", fmu3.token, fmi3.recorder(log), vr, size, logging=False) is None
        (message,) = log
        assert "requiredIntermediateVariables" in message.text
