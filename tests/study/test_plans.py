"""Every mistake in a plan is reported in one line before anything is run."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.study.plan.model import read_model
from rov_fmu.study.plan.plan import load_plan
from rov_fmu.study.plan.prepared import prepare
from rov_fmu.vehicle.shipped import VIDEORAY
from tests.folders import beside
from tests.io.test_paths import WRONG as WRONG_PATHS

HEAD = 'fmu = "videoray.fmu"\nstop_time = 1.0\nstep = 0.1\nruns = 4\n'
TAIL = '[figures]\nend = "u[-1]"\n'
VARY = "[vary]\nalpha_u.uniform = [1.0, 1.2]\n"
PLAN = HEAD + VARY


def figure(expression: str) -> str:
    """A plan with one figure, of this expression in the quotes of TOML."""
    return f"{PLAN}[figures]\nend = {expression}\n"


WRONG = {
    "": "stop_time: this key is missing",
    "fmu = 1": "fmu = 1: must be text in quotes",
    'stop = 3.0\nfmu = "videoray.fmu"': "stop: there is no such key; did you mean step?",
    HEAD.replace("1.0", "0.95")
    + VARY
    + TAIL: "stop_time = 0.95: must be a whole number of steps of 0.1 s after the start",
    HEAD.replace("1.0", "-1.0") + VARY + TAIL: "stop_time = -1.0: must be after start_time = 0",
    HEAD.replace("4", "0") + VARY + TAIL: "runs = 0: must be within 1 ... 1e+08",
    PLAN: "must have [keep] or [figures], or nothing remains of a run",
    HEAD + TAIL: 'vary: nothing varies: write [vary], or sampler = "grid" for the one run',
    HEAD
    + 'sampler = "grid"\n[vary]\nalpha_u.values = [1.0]\n'
    + TAIL: "runs = 4: a grid has as many as it has points; leave this out",
    HEAD.replace("runs = 4", 'sampler = "grid"')
    + VARY
    + TAIL: "vary.alpha_u = {'uniform': (1.0, 1.2)}: a grid needs values or a range",
    HEAD.replace("runs = 4", 'sampler = "grid"')
    + "[vary]\n"
    + "".join(f"{name}.range = {{ from = 1.0, to = 2.0, count = 1000 }}\n" for name in ("m_rov", "I_r", "R"))
    + TAIL: "vary: a grid must have at most 100000000 points, and not 1e+09",
    HEAD
    + 'sampler = "soboll"\n'
    + VARY
    + TAIL: "sampler = 'soboll': must be 'grid', 'sobol', 'latin-hypercube', 'random' or 'saltelli'",
    HEAD + 'vehicle = "videoray"\n' + VARY + TAIL: "must have either fmu or vehicle",
    HEAD.replace('fmu = "videoray.fmu"', 'vehicle = "videory"')
    + VARY
    + TAIL: "vehicle = 'videory': there is no such file beside the plan, and no vehicle of this name ships, only bl",
    HEAD + 'vary_from = "mine.toml"\n' + TAIL: "vary_from = 'mine.toml': there is no such file beside the plan",
    HEAD + 'vary_from = "videoray"\n' + TAIL: "vary_from = 'videoray': no coefficient of this vehicle has an interval",
    HEAD
    + "[vary]\nalpha_uu.uniform = [1.0, 1.2]\n"
    + TAIL: "vary.alpha_uu: the FMU has no variable 'alpha_uu' that is a number; did you mean alpha_",
    HEAD + "[vary]\nalpha_u.uniform = [-1.0, 1.2]\n" + TAIL: "vary.alpha_u = -1.0: must be within 0 ... 1000",
    HEAD + "[vary]\nalpha_u.values = [1.0, 1e9]\n" + TAIL: "vary.alpha_u = 1000000000.0: must be within 0 ... 1000",
    HEAD
    + "[vary]\nm_rov.normal = { mean = -1.0, sd = 1.0 }\n"
    + TAIL: "vary.m_rov = -1.0: must be within 0.001 ... 1000000 kg",
    HEAD
    + "[vary]\nalpha_u = { uniform = [1.0, 2.0], values = [1.0] }\n"
    + TAIL: "vary.alpha_u: must have one of normal, lognormal, uniform,",
    HEAD + "[vary]\nF_l.uniform = [1.0, 2.0]\n" + TAIL: "vary.F_l: the FMU computes it, and it cannot be set",
    PLAN + "[set]\nalpha_u = 1.0\n" + TAIL: "vary.alpha_u: is given in [set] or [inputs] too",
    PLAN + "[set]\nm_rov = 0.0\n" + TAIL: "set.m_rov = 0.0: must be within 0.001 ... 1000000 kg",
    PLAN + "[inputs]\nu_l = 1.5\n" + TAIL: "inputs.u_l = 1.5: must be within -1 ... 1",
    PLAN + "[inputs]\nu = 0.5\n" + TAIL: "inputs.u: is no input of the FMU; its causality is output",
    PLAN
    + '[inputs]\nu_l = "full"\n'
    + TAIL: "inputs.u_l = 'full': must be a number, { steps = [[time, value], ...] } or { ramps = ... }",
    PLAN + "[inputs]\nu_l.steps = []\n" + TAIL: "inputs.u_l.steps = []: must have an entry",
    PLAN
    + "[inputs]\nu_l.ramps = [[1.0, 0.0], [0.5, 1.0]]\n"
    + TAIL: "inputs.u_l.ramps = [[1.0, 0.0], [0.5, 1.0]]: the time must not go back, as it does from 1 to 0.5",
    PLAN
    + "[inputs]\nu_l.steps = [[0.2, 0.5], [0.55, 0.0]]\n"
    + TAIL: "inputs.u_l = [0.55, 0.0]: a jump, as from 0.5 here, must be at a communication point, a multiple of step",
    PLAN
    + "[inputs]\nu_l.ramps = [[0.0, 0.0], [0.45, 0.5], [0.45, 0.0]]\n"
    + TAIL: "inputs.u_l = [0.45, 0.0]: a jump, as from 0.5 here, must be at a communication point",
    PLAN + '[keep]\noutputs = ["q"]\n': "keep.outputs: the FMU has no variable 'q' that is a number",
    PLAN + '[keep]\noutputs = ["u", "u"]\n': "keep.outputs = ['u', 'u']: must name each once",
    PLAN + '[keep]\noutputs = ["u"]\nevery = 2.0\n': "keep.every = 2.0: must not be longer than a run",
    PLAN + '[keep]\noutputs = ["u"]\nevery = 0.25\n': "keep.every = 0.25: must be a multiple of step = 0.1",
    PLAN
    + '[keep]\noutputs = ["u"]\nat = [0.5, 1.1]\n': "keep.at = [0.5, 1.1]: must be times from the start to the end",
    figure('"u[-1"'): "figures.end = 'u[-1': is no expression: '[' was never closed",
    figure('"q[-1]"'): "figures.end = 'q[-1]': 'q' is neither a function nor a variable",
    figure('"np.max(u)"'): "figures.end = 'np.max(u)': np.max is an attribute, which is not allowed: write max(...)",
    figure('"V_ss(u, 0, 100)"'): "figures.end = 'V_ss(u, 0, 100)': there is no time 100 s in a run from 0 to 1 s",
    HEAD
    + "[vary]\nx.uniform = [0.0, 1.0]\n"
    + '[figures]\nend = "final(x)"\n': "figures.end = 'final(x)': TypeError: 'float' object is not subscriptable; x",
    figure('"open(1)"'): "figures.end = 'open(1)': 'open' is neither a function nor a",
    figure('"sum(loadtxt(1))"'): "figures.end = 'sum(loadtxt(1))': 'loadtxt' is neither",
    figure('"u"'): "figures.end = 'u': must be one number, and not array(",
    figure('"V_ss()"'): "figures.end = 'V_ss()': V_ss takes 1 to 3 values (y, start, end), each once, and not 0",
    figure(
        '"(lambda: 1)()"'
    ): "figures.end = '(lambda: 1)()': lambda: 1 is not allowed; an expression has numbers, variables, operators, ind",
    figure('"max"'): "figures.end = 'max': max is a function: write max(...)",
    figure('"out[0]"'): "figures.end = 'out[0]': out gives a variable by its name: write out[\"der(u)\"]",
    figure('"final(out[\\"q\\"])"'): "figures.end = 'final(out[\"q\"])': 'q' is neither a function nor a variable",
    figure('"mex(u)"'): "figures.end = 'mex(u)': 'mex' is neither a function nor a variable",
    PLAN + '[figures]\n" " = "u[-1]"\n': "figures.  = ' ': must not be blank",
    PLAN + '[figures]\nalpha_u = "u[-1]"\n': "figures.alpha_u: the results have another column of this name",
}


@pytest.mark.parametrize("text", WRONG, ids=WRONG.values())
def test_a_mistake_is_a_line_and_nothing_is_written(
    text: str, tmp_path: Path, videoray_fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    shutil.copy(videoray_fmu, tmp_path / "videoray.fmu")
    assert main(["study", str(plan), "-o", str(tmp_path / "results")]) == 2
    told = capsys.readouterr().err
    assert f": {WRONG[text]}" in told
    if text.startswith(HEAD):
        assert told.count("\n") == 1
    assert not (tmp_path / "results").exists()


def test_a_vehicle_file_is_seen_from_the_plan_and_not_from_where_the_command_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(VIDEORAY, tmp_path / "mine.toml")
    plan = tmp_path / "plans" / "plan.toml"
    plan.parent.mkdir()
    plan.write_text(HEAD.replace('fmu = "videoray.fmu"', 'vehicle = "mine.toml"') + VARY + TAIL)
    monkeypatch.chdir(tmp_path)
    assert main(["study", str(plan), "-o", "results"]) == 2
    assert f"{plan}: vehicle = 'mine.toml': there is no such file beside the plan" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("key", ["fmu", "vehicle", "vary_from", "input_file.path"])
@pytest.mark.parametrize("case", WRONG_PATHS)
def test_a_path_that_does_not_stay_in_the_folder_of_the_plan_is_refused(
    key: str, case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, told = WRONG_PATHS[case]
    plan = tmp_path / "here" / "plan.toml"
    (plan.parent / "tables").mkdir(parents=True)
    (tmp_path / "secrets").mkdir()
    for secret in ("secret", "secrets/model.png"):
        (tmp_path / secret).write_text("time,u_l\n0,0.123\n")
    (plan.parent / "link").symlink_to(tmp_path / "secret")
    (plan.parent / "links").symlink_to(tmp_path / "secrets", target_is_directory=True)
    head = HEAD if key != "fmu" else HEAD.replace('fmu = "videoray.fmu"\n', "")
    plan.write_text(f'{key} = "{name}"\n{head}' + VARY + TAIL)
    (plan.parent / "videoray.fmu").touch()
    assert main(["study", str(plan), "-o", str(tmp_path / "results")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"rov-fmu: {plan}: {key} = ")
    assert told in said
    assert said.count("\n") == 1
    assert not (tmp_path / "results").exists()


def test_mistakes_of_all_kinds_are_told_at_once(
    tmp_path: Path, videoray_fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(videoray_fmu, tmp_path / "videoray.fmu")
    (tmp_path / "u.csv").write_text("time,u_r\n0,much\n")
    head = HEAD.replace("1.0", "0.95").replace("runs = 4\n", 'input_file = { path = "u.csv" }\n')
    (tmp_path / "plan.toml").write_text(head + VARY + "[inputs]\nu_l = 1.5\n" + '[figures]\nend = "q[-1]"\n')
    assert main(["study", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "results")]) == 2
    told = [line.split(":")[2].split()[0] for line in capsys.readouterr().err.splitlines()]
    assert told == ["stop_time", "runs", "inputs.u_l", "figures.end", "row"]


def test_what_is_no_fmu_for_co_simulation_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(HEAD + VARY + TAIL)
    (tmp_path / "videoray.fmu").write_bytes(b"no archive")
    assert main(["study", str(plan), "-o", str(tmp_path / "results")]) == 2
    assert capsys.readouterr().err.startswith(f"rov-fmu: {tmp_path / 'videoray.fmu'}: is no FMU, or a damaged one: ")


@pytest.mark.parametrize(
    ("rows", "told"),
    {
        "time,u_l\n0,0\n\n0.1,1.5\n": "row 2, column 'u_l' = 1.5 at 0.1 s: must be within -1 ... 1",
        "time,u_l\n0.03,0.5\n0.1,0.5\n": "row 1, column 'u_l' = 0.5 at 0.03 s: a jump, as from 0 here, must be at a ",
        "time,u_l\n0,0\n0.5,full\n": "row 2, column 'u_l' = 'full': must be a number",
        "time,u\n0,0\n": "column 'u': is no input of the FMU; its causality is output",
        "time,u_r\n0,0\n": "column 'u_r': is given in [inputs] too",
    }.items(),
)
def test_a_mistake_in_a_file_of_inputs_is_told_by_its_row(
    rows: str, told: str, tmp_path: Path, videoray_fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "u.csv").write_text(rows)
    shutil.copy(videoray_fmu, tmp_path / "videoray.fmu")
    file = 'input_file = { path = "u.csv", between = "steps" }\n'
    (tmp_path / "plan.toml").write_text(HEAD + file + VARY + "[inputs]\nu_r = 0.5\n" + TAIL)
    assert main(["study", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "results")]) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"rov-fmu: {tmp_path / 'u.csv'}: {told}")
    assert line.count("\n") == 1


def test_inputs_are_held_or_straight_by_the_middle_of_a_step_and_jump_where_two_points_are_of_one_time(
    foreign: Callable[..., Path], tmp_path: Path
) -> None:
    (tmp_path / "u.csv").write_text("time,u\n0.1,1\n0.3,3\n0.3,-1\n0.5,-1\n")
    fmu = beside(foreign(), tmp_path)
    head = f'fmu = "{fmu}"\nstop_time = 0.7\nstep = 0.1\nsampler = "grid"\n[keep]\noutputs = ["y"]\n'
    expected = {
        "[inputs]\nu = 0.5\n": [0.5] * 7,
        "[inputs]\nu.steps = [[0.2, 1.0], [0.3, 2.0], [0.6, 0.0]]\n": [0, 0, 1, 2, 2, 2, 0],
        "[inputs]\nu.ramps = [[0.1, 1.0], [0.3, 3.0], [0.3, -1.0], [0.5, -1.0]]\n": [0, 1.5, 2.5, -1, -1, -1, -1],
        "[inputs]\nu.steps = [[0.15, 0.0], [2.05, 1.0]]\n": [0] * 7,  # which are no jumps, or not of this run
        "[inputs]\nu.ramps = [[0.0, 0.0], [0.15, 3.0], [0.7, 3.0]]\n": [1, 3, 3, 3, 3, 3, 3],
        '[input_file]\npath = "u.csv"\n': [0, 1.5, 2.5, -1, -1, -1, -1],
        '[input_file]\npath = "u.csv"\nbetween = "steps"\n': [0, 1, 1, -1, -1, -1, -1],
    }
    for text, values in expected.items():
        path = tmp_path / "plan.toml"
        path.write_text(head + text)
        manoeuvre = prepare(load_plan(path), path, read_model(foreign())).job.manoeuvre
        assert manoeuvre.inputs["u"].tolist() == pytest.approx(values, abs=1e-12), text
