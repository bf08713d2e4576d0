"""Mass, ballast and the health of thrusters change during a run: velocities go on, an impossible mass is refused."""

import json
import struct
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Made
from tests.fmi import CO_SIMULATION, DISCARD, ERROR, EVENT, MODEL_EXCHANGE, STEP, WITH_EVENTS, Fmu
from tests.fmu.calls.conftest import of_both_versions
from tests.fmu.calls.test_state_bytes import checksum
from tests.vehicles import SIX, a_vehicle
from verification.references import rigid_vehicle
from verification.references.rigid_vehicle import compared, places

ROV = a_vehicle(SIX)
COMMANDS = {"u_a": 0.5, "u_b": -0.4, "u_c": 0.3}
INPUTS = (
    ROV.layout.usual_inputs
    | COMMANDS
    | {"X_ext": 6.0, "Y_ext": -2.0, "Z_ext": 3.0, "K_ext": 0.3, "N_ext": 0.2, "V_N": 0.1}
)
BALLAST = {name: factor * ROV[name] for name, factor in {"m_rov": 1.3, "W": 1.25, "B": 1.1, "z_G": 0.8}.items()}
BALLAST |= {"x_B": ROV["x_B"] + 0.01, "y_G": ROV["y_G"] - 0.005}
CHANGES = BALLAST | {"health_a": 0.3, "health_b": 0.0}
"""With the ballast, a thruster fouls and another one dies."""
IMPOSSIBLE = {"m_rov": 2.0 * ROV["m_rov"], "z_G": 50.0}


fmu = of_both_versions("six_dir", "outside3_dir", is_two_weekly=True)


def _restarted(folder: Path) -> None:
    """Write what the rigid body of 6x6 matrices is compared by after 20 s, restarted with the changes at 10 s."""
    y: Any = places(ROV, ROV.layout.at_rest)
    for rov in (ROV, ROV.with_(**CHANGES)):
        y = rigid_vehicle.integrate(rov, INPUTS, y, 10.0)
    (folder / "end.json").write_text(json.dumps([float(x) for x in compared(ROV, list(y))]), encoding="utf-8")


@pytest.fixture(scope="module")
def expected(made_once: Made) -> list[float]:
    found: list[float] = json.loads((made_once("ballast", _restarted) / "end.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("is_event", [False, True])
def test_a_run_with_changes_from_10_s_on_is_the_rigid_body_restarted_there(
    fmu: Fmu, expected: list[float], is_event: bool
) -> None:
    """Between steps, and in FMI 3.0 in Event Mode. The flavour in Python agrees by tests/fmu/test_python_flavour.py."""
    with fmu.instance(WITH_EVENTS if is_event and fmu.VERSION == 3 else CO_SIMULATION) as rov:
        rov.set(INPUTS)
        rov.reach(STEP)
        rov.step(0.0, 10.0)
        velocities = rov.get([*ROV.layout.velocities])
        if rov.kind == WITH_EVENTS:
            rov.expect("EnterEventMode")
        rov.set(CHANGES)
        if rov.kind == WITH_EVENTS:
            rov.update()
            rov.expect("EnterStepMode")
        assert rov.get([*ROV.layout.velocities]) == velocities
        rov.step(10.0, 10.0)
        state = dict(zip(ROV.layout.state, rov.get([*ROV.layout.state]), strict=True))
        assert rov.log == []
    assert compared(ROV, places(ROV, state)) == pytest.approx(expected, abs=1e-10)


def test_a_mass_that_is_not_positive_definite_is_refused_and_nothing_changes(fmu: Fmu) -> None:
    for kind, mode in ((CO_SIMULATION, STEP), (MODEL_EXCHANGE, EVENT)):
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            before = rov.get([*ROV.coefficients, "der(u)", "der(q)"])
            rov.log.clear()
            rov.set(IMPOSSIBLE, DISCARD)
            (line,) = rov.log
            assert "the mass matrix of these parameters is not positive definite" in line.text
            assert rov.get([*ROV.coefficients, "der(u)", "der(q)"]) == before
            rov.set(BALLAST)
            assert rov.get(["m_rov", "z_G"]) == [BALLAST["m_rov"], BALLAST["z_G"]]


def test_a_saved_state_contains_the_ballast_and_no_impossible_mass(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start(INPUTS)
        rov.step(0.0, 1.0)
        rov.set(BALLAST)
        saved = rov.save()
        after = rov.trajectory(range(10, 20))
        rov.set({"m_rov": ROV["m_rov"]})
        rov.load(saved)
        assert rov.trajectory(range(10, 20)) == after
        first = 8 + len(fmu.token) + 8 * 6
        place = first + 8 * (fmu.vr["z_G"] - min(fmu.vr[name] for name in fmu.commands))
        assert struct.unpack_from("<d", saved, place) == (BALLAST["z_G"],)
        content = saved[:place] + struct.pack("<d", IMPOSSIBLE["z_G"]) + saved[place + 8 : -8]
        rov.load(content + checksum(content), ERROR)
        assert "values that no run can reach" in rov.log[-1].text
