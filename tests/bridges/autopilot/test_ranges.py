"""The autopilot's FMU holds what is set to the ranges that its description tells."""

from collections.abc import Mapping

import numpy as np
import pytest

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import autopilot_fmu
from rov_fmu.fmus.fmu import Fmu
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

HEAVY = load_vehicle(SHIPPED["bluerov2_heavy"])


@pytest.fixture(scope="module", params=[2, 3])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """The FMU for this machine, of both versions of FMI."""
    path = tmp_path_factory.mktemp("fmu") / "autopilot.fmu"
    path.write_bytes(autopilot_fmu(autopilot_of(HEAVY), ["host"], request.param))
    return Fmu.open(path, is_ours=True)


@pytest.mark.parametrize(
    ("given", "acts_as"),
    [
        *(
            ({"mode_w": mode, "ref_z": 2.0}, {"mode_w": 2.0, "ref_z": 2.0})
            for mode in (3.0, 7.0, 40.0, 1e5, 1e9, 1e300)
        ),
        *(({"mode_w": mode, "stick_w": 0.4}, {"mode_w": 0.0, "stick_w": 0.4}) for mode in (-1.0, -1e9, -1e300)),
        ({"mode_r": 1e9, "ref_psi": 0.4}, {"mode_r": 2.0, "ref_psi": 0.4}),
        ({"stick_u": 5.0, "stick_v": 0.5}, {"stick_u": 1.0, "stick_v": 0.5}),
        ({"stick_u": 0.5, "sag": 7.0}, {"stick_u": 0.5, "sag": 1.0}),
    ],
)
def test_an_input_beyond_its_range_acts_as_its_end(
    fmu: Fmu, given: Mapping[str, float], acts_as: Mapping[str, float]
) -> None:
    """As the warning says. A mode of 1e9 was an index into a table, and ended the importer's process."""
    commands, times = [*HEAVY.layout.commands, *given], np.linspace(0.0, 0.38, 20)
    results = [fmu.run(times, {}, commands, start) for start in (given, acts_as)]
    for name in commands:
        assert [*results[0][name]] == [*results[1][name]], name
    assert any(any(results[0][name]) for name in HEAVY.layout.commands) or "sag" in given
