"""Bytes are restored only if they are a state of this FMU with a mode and values that a run can reach."""

import ctypes
import struct
from ctypes import c_void_p
from math import inf, nan

import pytest

from tests.fmi import CO_SIMULATION, ERROR, INITIALIZATION, AnyInstance, Fmu


@pytest.fixture(scope="module")
def serialized(fmu: Fmu) -> bytes:
    """Return a serialized state between steps."""
    with fmu.instance() as rov:
        rov.start({"u_l": 0.3, "u": -0.4, "r": 0.9, "beta_u": 0.7, "V_E": 0.25}, stop=1.0)
        rov.step(0.0, 0.5)
        return rov.save()


def checksum(content: bytes) -> bytes:
    """Return the FNV-1a checksum, which is the last eight bytes of a state."""
    value = 14695981039346656037
    for byte in content:
        value = (value ^ byte) * 1099511628211 % 2**64
    return struct.pack("<Q", value)


def assert_refused(rov: AnyInstance, content: bytes) -> None:
    """Assert that the bytes are an error, and change neither the instance nor *FMUstate, be it NULL or a state."""
    nothing, state = c_void_p(), c_void_p()
    rov.expect("GetFMUState", ctypes.byref(state))
    before, address = rov.save(), state.value
    rov.log.clear()
    assert rov.deserialize(content, nothing) == ERROR
    assert nothing.value is None
    assert rov.deserialize(content, state) == ERROR
    assert [m.category for m in rov.log] == ["logStatusError"] * 2
    assert all(m.text.startswith(f"{rov.fmu.name('DeserializeFMUState')}: ") for m in rov.log)
    assert (state.value, rov.save(state), rov.save()) == (address, before, before)
    rov.expect("FreeFMUState", ctypes.byref(state))


def test_no_byte_of_a_state_can_be_damaged(fmu: Fmu, serialized: bytes) -> None:
    with fmu.instance() as rov:
        for i in range(len(serialized)):
            for damage in (0x01, 0x80, 0xFF):
                assert_refused(rov, serialized[:i] + bytes([serialized[i] ^ damage]) + serialized[i + 1 :])


def test_a_state_cut_short_extended_or_foreign_is_refused(fmu: Fmu, serialized: bytes) -> None:
    with fmu.instance() as rov:
        for cut in (b"", serialized[:8], serialized[:-1], serialized + b"\0", serialized * 2):
            assert_refused(rov, cut)
        for foreign in (bytes(len(serialized)), serialized[8:] + serialized[:8]):
            assert_refused(rov, foreign)
            assert_refused(rov, foreign[:-8] + checksum(foreign[:-8]))
        guid = fmu.token
        another = serialized.replace(guid, guid[:-2] + bytes([guid[-2] ^ 1]) + guid[-1:])
        assert_refused(rov, another[:-8] + checksum(another[:-8]))


def test_values_that_no_run_can_reach_are_refused_even_with_the_right_checksum(fmu: Fmu) -> None:
    marks = {name: 0.5 + i / 1024 for i, name in enumerate(fmu.inputs + fmu.states + fmu.parameters)}
    with fmu.instance() as rov:
        rov.initialize(start=0.4375)
        rov.set(marks)
        good = rov.save()
        places = {name: good.index(struct.pack("<d", value)) for name, value in {**marks, "time": 0.4375}.items()}

        def with_value(name: str, value: float) -> bytes:
            content = bytearray(good[:-8])
            struct.pack_into("<d", content, places[name], value)
            return bytes(content) + checksum(bytes(content))

        assert with_value("u", marks["u"]) == good
        rov.load(with_value("u", -8.5))
        assert rov.mode() == INITIALIZATION
        for name in places:
            for value in (nan, inf, -inf):
                assert_refused(rov, with_value(name, value))
        for name in fmu.parameters:
            low, high = fmu.bounds(name)
            for value in (low - 1e-9, high * 1.001):
                assert_refused(rov, with_value(name, value))


@pytest.mark.parametrize(
    ("word", "value"),
    [
        *((0, interface) for interface in (2, 2**32)),
        *((1, mode) for mode in (0, 3, 4, 17, 2**32 + 16)),  # 4 is a mode of Model Exchange
        *((2, flags) for flags in (0, 2, 4)),  # without an experiment there is no Step Mode
    ],
)
def test_a_mode_that_no_run_can_be_in_is_refused(fmu: Fmu, serialized: bytes, word: int, value: int) -> None:
    start = len(b"ROVSTATE") + len(fmu.token)
    content = bytearray(serialized[:-8])
    interface, mode, flags = struct.unpack_from("<3Q", content, start)
    assert (interface, mode, flags) == (CO_SIMULATION, 16, 3)
    struct.pack_into("<Q", content, start + 8 * word, value)
    with fmu.instance() as rov:
        assert_refused(rov, bytes(content) + checksum(bytes(content)))
