"""A vehicle runs in lanes as its FMU does, whatever it has."""

import shutil
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from rov_fmu import Results, run_study
from rov_fmu.cli import main
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.fmus.simulation import Simulation
from rov_fmu.fmus.variable import variables_of
from rov_fmu.io.messages import FileError
from rov_fmu.report.progress import StudyProgress
from rov_fmu.study.plan.model import vehicle_model
from rov_fmu.study.plan.plan import Plan
from rov_fmu.study.plan.sampling import Design
from rov_fmu.study.plan.study import Study, prepare
from rov_fmu.study.run.child import Child, simulator
from rov_fmu.study.run.local import Lanes, simulated
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import without_progress
from tests.often import spread
from tests.study.conftest import same
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
RUNS = 11


def _prepared(rov: Vehicle, **keys: Any) -> tuple[Study, Design]:
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


@pytest.mark.parametrize("kind", spread(KINDS, ("videoray", "everything"), ("passed", "rotors", "six")))
def test_each_variable_of_a_run_in_lanes_is_that_of_the_fmu(kind: str, request: pytest.FixtureRequest) -> None:
    """They are read before the first step and after each one, with the inputs of the step that ends there."""
    rov, folder = KINDS[kind], str(request.getfixturevalue(f"{kind}_dir"))
    study, design = _prepared(rov)
    values, fmu = design.rows(0, RUNS), simulator(folder, study)
    assert isinstance(fmu, Simulation)
    outputs, ended = simulated(study, rov, values)
    assert ended.all()
    worst: dict[str, float] = {}
    for own, row in zip(outputs, values.tolist(), strict=True):
        for name, found, told in zip(study.recorded, own, fmu.run(row).values(), strict=True):
            worst[name] = max(worst.get(name, 0.0), np.abs(found - told).max() / max(1.0, np.abs(told).max()))
    assert max(worst.values()) < 1e-12, {n: v for n, v in worst.items() if v > 1e-12}


@pytest.mark.parametrize("kind", spread(KINDS, ("videoray", "everything"), ("passed", "rotors", "six")))
def test_a_run_has_the_same_bits_whatever_runs_beside_it(kind: str) -> None:
    (study, design), rov = _prepared(KINDS[kind]), KINDS[kind]
    values = design.rows(0, RUNS)
    together, _ = simulated(study, rov, values, 1)
    for order in ([0], [7, 3], [*range(RUNS)][::-1]):
        assert np.array_equal(simulated(study, rov, values[order], 2)[0], together[order])


@pytest.mark.parametrize("kind", spread(KINDS, ("videoray", "everything"), ("passed", "rotors", "six")))
def test_a_vehicle_has_the_variables_of_its_fmu(kind: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(f"{kind}_dir")
    own = variables_of(fmpy.read_model_description(str(folder), validate=False))
    computed = {name: replace(own[name], can_be_set=False) for name in QUATERNION if name in own}
    assert vehicle_model(KINDS[kind]).variables == own | computed


PLAN = """vehicle = "videoray"
stop_time = 2.0
step = 0.1
runs = 40
seed = 5
[inputs]
u_l = 0.3
u_r.steps = [[0.0, 0.3], [1.0, -0.4]]
[vary]
m_rov.uniform = [6.0, 7.0]
alpha_u.normal = { mean = 1.1, sd = 0.1 }
[keep]
outputs = ["u", "F_r"]
every = 0.5
[figures]
end = "x[-1]"
"""


def _plan(folder: Path, text: str = PLAN) -> Path:
    path = folder / "plan.toml"
    path.write_text(text)
    return path


def test_a_figure_has_its_own_values_under_any_name(tmp_path: Path) -> None:
    """Also under a name that a run has for something else."""
    names = ("turned", "columns", "seconds", "time")
    figures = "".join(f'{name} = "u[-1]"\n' for name in (*names, "V"))
    found = run_study(
        _plan(tmp_path, f"{PLAN.partition('[figures]')[0]}[figures]\n{figures}"), tmp_path / "results"
    ).runs
    assert found.V.abs().min() > 0.0
    for name in names:
        assert (found[name] == found.V).all()


@pytest.mark.parametrize("sampler", spread(["sobol", "random", "latin-hypercube", "saltelli"], ["sobol"], ["saltelli"]))
def test_parts_are_merged_to_the_bits_of_one_run(
    sampler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also with other numbers of runs and threads at a time."""
    plan, parted = _plan(tmp_path, f'sampler = "{sampler}"\n{PLAN}'), tmp_path / "parted"
    whole = run_study(plan, tmp_path / "whole", workers=1)
    given = ["study", str(plan), "-o", str(parted)]
    monkeypatch.setattr("rov_fmu.study.run.local._MOST", 5)
    for part in ("1/3", "3/3"):
        assert main([*given, "--part", part]) == 0
    assert not [*parted.glob("*.html")]
    capsys.readouterr()
    assert main([*given, "--merge"]) == 2
    (line,) = without_progress(capsys.readouterr().err).splitlines()
    lacking = f"rov-fmu: {parted}: of {whole.planned} runs, these are missing: {whole.planned // 3} to "
    assert line.startswith(lacking)
    assert line.endswith(": do them with --part, or copy their files into runs")
    run_study(plan, tmp_path / "elsewhere", part=(2, 3), workers=2)
    assert len(Results(tmp_path / "elsewhere").runs) in (13, 14)
    shutil.copytree(tmp_path / "elsewhere" / "runs", parted / "runs", dirs_exist_ok=True)
    assert main([*given, "--merge"]) == 0
    same(Results(parted), whole)
    assert (parted / "study.html").exists()
    assert main([*given, "--part", "1/2"]) == 0, "there is nothing left to do"
    assert main(given) == 0, "it is a study like any other"


def test_two_parts_run_beside_each_other(tmp_path: Path) -> None:
    plan, folder = _plan(tmp_path), tmp_path / "results"
    whole = run_study(plan, tmp_path / "whole")

    def beside(_: StudyProgress) -> None:
        with pytest.raises(FileError, match="another study is writing there"):
            run_study(plan, folder, part=(1, 2))
        run_study(plan, folder, part=(2, 2))

    run_study(plan, folder, part=(1, 2), on_progress=beside)
    same(run_study(plan, folder, merge=True), whole)


def test_an_interrupted_study_in_lanes_goes_on_without_a_lost_or_double_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, progress = _plan(tmp_path), list[StudyProgress]()
    whole = run_study(plan, tmp_path / "whole")
    monkeypatch.setattr("rov_fmu.study.run.local._MOST", 7)

    def interrupt(now: StudyProgress) -> None:
        progress.append(now)
        if now.done >= 21:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(plan, tmp_path / "results", on_progress=interrupt)
    interrupted = progress[-1].done
    assert 21 <= interrupted == len(Results(tmp_path / "results").runs) < 40
    monkeypatch.setattr("rov_fmu.study.run.local._MOST", 4)
    same(run_study(plan, tmp_path / "results", on_progress=progress.append), whole)
    done = [now.done for now in progress]
    assert (done[0], done.count(interrupted), done[-1]) == (0, 2, 40), "it goes on where it was"
    assert {now.total for now in progress} == {40}


@pytest.mark.long
def test_a_run_that_diverges_or_has_no_mass_matrix_has_the_reason_of_the_fmu(six_dir: Path) -> None:
    rov = KINDS["six"]
    study, design = _prepared(
        rov,
        vary={"m_a_uq": {"values": [rov["m_a_uq"], 1e3]}, "u": {"values": [0.1, 1e200]}},
        sampler="grid",
        runs=None,
        keep={"outputs": ["x"]},
        figures={"end": "x[-1]"},
    )
    with closing(Lanes(study, rov, "", None)) as lanes:
        lanes.fmu = Child(six_dir, study)  # type: ignore[assignment]
        found = lanes.runs(design.rows(0, 4))
    assert [run.columns["status"] for run in found] == ["done", "failed", "failed", "failed"]
    reasons = [run.columns["reason"] or "" for run in found]
    assert reasons[1].startswith("the step at 0 s: ")
    assert reasons[2] == reasons[3]
    assert "the mass matrix of these parameters is not positive definite" in reasons[2]
