"""The FMU says once that a vehicle has left the water, unless its model has a surface."""

from dataclasses import replace
from pathlib import Path

import pytest

from rov_fmu.equation.words import LEFT_WATER
from rov_fmu.fmu.model_description import model_of
from rov_fmu.fmu.variables import interface_header
from tests.fmi import Fmu
from tests.fmu.calls.conftest import of_both_versions
from tests.fmu.test_python_flavour import Slave
from tests.vehicles import HEAVY, VIDEORAY, a_vehicle, surfaced

fmu = of_both_versions("videoray_dir", "videoray3_dir")


def test_it_is_told_once(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start({"u_t": -0.5, "z": 0.001})
        for n in range(3):
            rov.step(0.5 * n, 0.5)
            assert len(rov.log.of_water) == (0 if rov.get(["z"])[0] > 0.0 else 1)
        (message,) = rov.log.of_water
        assert message.text.endswith(f": {LEFT_WATER.format(0.5)}; logged once.")
        assert not rov.log


def test_the_flavour_in_python_tells_it_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slave = Slave(replace(a_vehicle(HEAVY), identifier="rising"), tmp_path, monkeypatch)
    slave.rov.exit_initialization_mode()
    slave.put(Z_ext=-20.0)
    assert [slave.step(0.1 * n, 0.1)[1] for n in range(2)] == [[f"{LEFT_WATER.format(0.1)}; logged once."], []]


def test_a_vehicle_with_a_surface_may_float() -> None:
    headers = (interface_header(model_of(a_vehicle(rov)), "y", 2, ()) for rov in (VIDEORAY, surfaced(VIDEORAY)))
    assert ["enum { DEPTH = REF_z };" in header for header in headers] == [True, False]
