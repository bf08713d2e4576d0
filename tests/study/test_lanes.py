"""A vehicle runs in lanes as its FMU does, whatever it has."""

import io
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
import pytest

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.fmus.simulation import Simulation
from rov_fmu.fmus.variable import variables_of
from rov_fmu.study.model import vehicle_model
from rov_fmu.study.plan import FAILED, STATUS, TIME, TRAJECTORY, Plan
from rov_fmu.study.run import Block, _Machine
from rov_fmu.study.study import Study, prepare
from rov_fmu.vehicle.shipped import VIDEORAY as VIDEORAY_FILE
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import spread
from tests.vehicles import EVERYTHING, HEAVY, SIX, THRUST_EFFECTS, VIDEORAY, a_vehicle, passed, with_rotors

KINDS: dict[str, Vehicle] = {
    "videoray": VIDEORAY,
    "heavy": HEAVY,
    "everything": load_vehicle(EVERYTHING),
    "thrust": load_vehicle(THRUST_EFFECTS),
    "rotors": a_vehicle(with_rotors(SIX)),
    "passed": a_vehicle(passed(HEAVY)),
    "six": a_vehicle(SIX),
}
"""The vehicles whose FMUs the tests have in a folder (tests/conftest.py), by the name of that folder."""
SOME = spread(KINDS, ("videoray", "everything"), ("passed", "rotors", "six"))
RUNS = 11


def _prepared(rov: Vehicle, **keys: Any) -> Study:
    """Return a plan in which all inputs change, and states, inputs and coefficients vary; every variable is kept."""
    layout, model = rov.layout, vehicle_model(rov)
    signals = {}
    for n, (name, declared) in enumerate(layout.inputs.items()):
        low, high = max(declared.minimum, declared.start - 0.3), min(declared.maximum, declared.start + 0.3)
        signals[name] = {
            "ramps": [[0.0, low + 0.05 * n * (high - low)], [0.7, high], [0.7, low], [1.5, declared.start]]
        }
    state, value = next(iter(layout.velocities)), rov["m_rov"]
    plan: dict[str, Any] = {
        "vehicle": "rov",
        "stop_time": 2.0,
        "step": 0.1,
        "runs": RUNS,
        "inputs": {name: signal for name, signal in signals.items() if model.variables[name].is_continuous},
        "vary": {
            "m_rov": {"uniform": [0.9 * value, 1.1 * value]},
            state: {"uniform": [-0.1, 0.2]},
            **({"psi_0": {"values": [0.0, 2.0]}} if layout.initial else {}),
        },
        "keep": {"outputs": list(model.variables)},
        **keys,
    }
    return prepare(Plan.model_validate(plan), Path("plan.toml"), model)


def rows(study: Study, values: npt.NDArray[np.float64], workers: int) -> list[dict[str, Any]]:
    """Return the rows of a block of runs, as its file has them."""
    with closing(_Machine(study, workers=workers)) as machine:
        content, _ = machine.block(Block(0, values, "block.parquet"))
    found: list[dict[str, Any]] = pq.read_table(io.BytesIO(content)).to_pylist()
    return found


@pytest.mark.parametrize("kind", SOME)
def test_each_variable_of_a_run_in_lanes_is_that_of_the_fmu(kind: str, request: pytest.FixtureRequest) -> None:
    """They are read before the first step and after each one, with the inputs of the step that ends there."""
    folder, study = str(request.getfixturevalue(f"{kind}_dir")), _prepared(KINDS[kind])
    fmu = Simulation(folder, study.plan.times, study.plan.step, {}, study.inputs, study.recorded, study.varied, None)
    worst: dict[str, float] = {}
    for row, values in zip(rows(study, study.rows, 2), study.rows.tolist(), strict=True):
        assert row[STATUS] == "done"
        assert row[TRAJECTORY].pop(TIME) == study.plan.times.tolist()
        told = fmu.run(values)
        assert row[TRAJECTORY].keys() == told.keys() == vehicle_model(KINDS[kind]).variables.keys()
        for name, found in row[TRAJECTORY].items():
            off = np.abs(np.array(found) - told[name]).max() / max(1.0, np.abs(told[name]).max())
            worst[name] = max(worst.get(name, 0.0), off)
    assert max(worst.values()) < 1e-12, {n: v for n, v in worst.items() if v > 1e-12}


@pytest.mark.parametrize("kind", SOME)
def test_a_run_has_the_same_bits_whatever_runs_beside_it(kind: str) -> None:
    study = _prepared(KINDS[kind])
    together = rows(study, study.rows, 1)
    for order in ([0], [7, 3], [*range(RUNS)][::-1]):
        alone = rows(study, study.rows[order], 2)
        assert [row[TRAJECTORY] for row in alone] == [together[n][TRAJECTORY] for n in order]


@pytest.mark.parametrize("kind", SOME)
def test_a_vehicle_has_the_variables_of_its_fmu(kind: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(f"{kind}_dir")
    own = variables_of(fmpy.read_model_description(str(folder), validate=False))
    computed = {name: replace(own[name], can_be_set=False) for name in QUATERNION if name in own}
    assert vehicle_model(KINDS[kind]).variables == own | computed


def test_a_run_that_diverges_or_has_no_mass_matrix_fails_alone_with_its_reason() -> None:
    rov = KINDS["six"]
    study = _prepared(
        rov,
        vary={"m_a_uq": {"values": [rov["m_a_uq"], 1e3]}, "u": {"values": [0.1, 1e200]}},
        sampler="grid",
        runs=None,
        keep={"outputs": ["x"]},
        figures={"end": "x[-1]"},
    )
    found = rows(study, study.rows, 1)
    assert [row[STATUS] for row in found] == ["done", FAILED, FAILED, FAILED]
    assert {row["reason"] for row in found[1:]} == {found[1]["reason"]}
    assert found[1]["reason"].startswith("the motion cannot be computed: ")
    assert found[1]["end"] is found[1][TRAJECTORY] is None


def test_a_study_of_a_vehicle_loads_neither_dask_nor_fmpy_nor_the_page(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(
        f'vehicle = "{VIDEORAY_FILE.stem}"\nstop_time = 1.0\nstep = 0.1\nruns = 3\n'
        '[vary]\nm_rov.uniform = [6.0, 7.0]\n[figures]\nend = "u[-1]"\n'
    )
    given = ["study", str(plan), "-o", str(tmp_path / "results"), "--part", "1/1"]
    program = f"import sys; from rov_fmu.cli import main; assert main({given}) == 0; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert "numpy" in loaded
    assert not {"distributed", "dask", "fmpy", "matplotlib", "rov_fmu.build"} & {*loaded}
    assert not [*(tmp_path / "results").glob("*.html")], "a part has no page"
