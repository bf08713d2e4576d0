"""Every mistake in a plan is reported in one line before anything is run."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.io.messages import FileError
from rov_fmu.study.model import read_model
from rov_fmu.study.run import prepared
from tests.folders import beside
from tests.io.test_paths import WRONG as WRONG_PATHS

HEAD = 'fmu = "videoray.fmu"\nstop_time = 1.0\nstep = 0.1\nruns = 4\n'
TAIL = '[figures]\nend = "u[-1]"\n'
VARY = "[vary]\nalpha_u.uniform = [1.0, 1.2]\n"
PLAN = HEAD + VARY
GRID = HEAD.replace("runs = 4", 'sampler = "grid"')
COUNTED = "".join(f"{name}.range = {{ from = 1.0, to = 2.0, count = 1000 }}\n" for name in ("m_rov", "I_r", "R"))

WHOLE = {
    "": "stop_time: this key is missing",
    'stop = 3.0\nfmu = "videoray.fmu"': "stop: there is no such key; did you mean step?",
    PLAN: "must have [keep] or [figures]. Otherwise nothing of a run is stored",
    HEAD + 'sampler = "grid"\n' + TAIL: "runs = 4: a grid has one run for each point: leave this key out",
    HEAD + TAIL: 'vary: nothing varies: write [vary], or sampler = "grid" for the one run',
    GRID + VARY + TAIL: "vary.alpha_u = {'uniform': (1.0, 1.2)}: a grid needs values or a range",
    f"{GRID}[vary]\n{COUNTED}{TAIL}": "vary: a grid must have at most 100000000 points, and not 1e+09",
    HEAD.replace("1.0", "0.95")
    + VARY
    + TAIL: "stop_time = 0.95: must be a whole number of steps of 0.1 s after the st",
    HEAD.replace("1.0", "0.0") + VARY + TAIL: "stop_time = 0.0: must be after start_time = 0",
    HEAD.replace("0.1", "5e-8") + VARY + TAIL: "step = 5e-08: must divide a run into at most 10000000 steps",
    HEAD.replace("0.1", "0.0") + VARY + TAIL: "step = 0.0: must be greater than 0",
    HEAD.replace("4", "0") + VARY + TAIL: "runs = 0: must be greater than or equal to 1",
    HEAD.replace("4", "1000000000") + VARY + TAIL: "runs = 1000000000: must be less than or equal to 100000000",
    HEAD.replace("runs = 4", "") + VARY + TAIL: "runs: this key is missing",
    HEAD.replace("4", "50000001") + VARY + TAIL: (
        "runs = 50000001: all are drawn before the first one, at most 50000000 with 1 variables"
    ),
    HEAD + "[vary]\nu_l.values = [0.0]\n[inputs]\nu_l = 0.5\n" + TAIL: "vary.u_l: is given in [set] or [inputs] too",
}
"""Plans and the beginnings of the messages about them."""
HEADS = {
    'sampler = "soboll"': "sampler = 'soboll': must be 'grid', 'sobol', 'latin-hypercube' or 'random'",
    'sampler = "saltelli"': """sampler = 'saltelli': write samples = "design.csv", a table of SALib: docs/studies.md""",
    'vehicle = "videoray"': "must have one of fmu, vehicle or system",
    'samples = "design.csv"': "samples = 'design.csv': has all that varies: leave runs and vary out",
    'vary_from = "mine.toml"': "vary_from = 'mine.toml': there is no such file beside the plan",
    'vary_from = "videoray"': "vary_from = 'videoray': no coefficient of this vehicle that [vary] and [set] leave has",
    "time_limit = 0": "time_limit = 0: must be greater than 0",
    "time_limit = 2e6": "time_limit = 2000000.0: must be less than or equal to 1000000",
    'sampler = "latin-hypercube"\nseed = 2.5': "seed = 2.5: must be a whole number",
    "seed = -1": "seed = -1: must be greater than or equal to 0",
}
"""Keys before the tables."""
VARIED = {
    "alpha_uu.uniform = [1.0, 1.2]": "vary.alpha_uu: the FMU has no variable 'alpha_uu' that is a number; did you mean",
    "alpha_u.uniform = [-1.0, 1.2]": "vary.alpha_u = -1.0: must be within 0 ... 1000",
    "alpha_u = { uniform = [1.0, 2.0], values = [1.0] }": "vary.alpha_u: must have one of normal, lognormal, uniform,",
    "F_l.uniform = [1.0, 2.0]": "vary.F_l: it cannot be set, because the FMU computes it",
    "alpha_u = {}": "vary.alpha_u: must have one of normal, lognormal, uniform, values or range",
    "alpha_u.uniform = [1.0, 1.0]": "vary.alpha_u.uniform = [1.0, 1.0]: must be [low, high]",
    "alpha_u.normal = { mean = -1.0, sd = 1.0 }": "vary.alpha_u = -1.0: must be within 0 ... 1000",
    "m_rov.lognormal = { median = 1e7, sd = 1.0 }": "vary.m_rov = 10000000.0: must be within 0.001 ... 1000000 kg",
    "u_l.values = [1.0, -2.0]": "vary.u_l = -2.0: must be within -1 ... 1",
    "u_l.range = { from = 0.0, to = 1.0, count = 1 }": "vary.u_l.range.count = 1: must be greater than or equal to 2",
}
"""Entries of [vary]."""
TABLES = {
    "[set]\nalpha_u = 1.0": "vary.alpha_u: is given in [set] or [inputs] too",
    "[set]\nm_rov = 0.0": "set.m_rov = 0.0: must be within 0.001 ... 1000000 kg",
    "[inputs]\nu_l = 1.5": "inputs.u_l: must be within -1 ... 1",
    "[inputs]\nu = 0.5": "inputs.u: is no input of the FMU; its causality is output",
    '[inputs]\nu_l = "full"': "inputs.u_l = 'full': must be a number, { steps = [[time, value], ...] } or { ramps",
    "[inputs]\nu_l.steps = []": "inputs.u_l.steps = []: must have an entry",
    "[inputs]\nu_l.ramps = [[1.0, 0.0], [0.5, 1.0]]": (
        "inputs.u_l.ramps = [[1.0, 0.0], [0.5, 1.0]]: the time must not go back, as it does from 1 to 0.5"
    ),
    "[inputs]\nu_l.steps = [[0.2, 0.5], [0.55, 0.0]]": ("inputs.u_l: a jump at 0.55 s must be at a multiple of step"),
    "[inputs]\nu_l = {}": "inputs.u_l: must have one of steps or ramps",
    "[inputs]\nu_l.ramps = [[0.0, 0.0], [0.55, 0.5], [0.55, 0.0]]": "inputs.u_l: a jump at 0.55 s must be",
    '[keep]\noutputs = ["u", "u"]': "keep.outputs = ['u', 'u']: must name each variable once",
    '[keep]\noutputs = ["u"]\nat = [0.5]': "keep.at: there is no such key: write every = 1.0, for example, and take",
    '[keep]\noutputs = ["q"]': "keep.outputs: the FMU has no variable 'q' that is a number",
    '[keep]\noutputs = ["u"]\nevery = 2.0': "keep.every = 2.0: must be a multiple of step = 0.1, and within a run",
    '[keep]\noutputs = ["u"]\nevery = 0.25': "keep.every = 0.25: must be a multiple of step = 0.1",
}
"""Tables after [vary]."""
FIGURES = {
    'end = "max(w.in)"': (
        "figures.end = 'max(w.in)': is no expression: invalid syntax; "
        "w.in ends with a word of Python: write out['w.in']"
    ),
    'end = "u[-1"': "figures.end = 'u[-1': is no expression: '[' was never closed",
    'end = "q[-1]"': "figures.end = 'q[-1]': 'q' is neither a function nor a variable",
    'end = "np.max(u)"': "figures.end = 'np.max(u)': 'np.max' is neither a function nor a variable",
    'end = "V_ss(u, 0, 100)"': "figures.end = 'V_ss(u, 0, 100)': there is no time 100 s in a run from 0 to 1 s",
    'end = "final(alpha_u)"': "figures.end = 'final(alpha_u)': a single number has no elements; alpha_u",
    'end = "u[11]"': "figures.end = 'u[11]': index 11 is out of bounds for axis 0 with size 11",
    'end = "u"': "figures.end = 'u': must be one number, and not an array",
    'end = "u[-12]"': "figures.end = 'u[-12]': index -12 is out of bounds for axis 0 with size 11",
    f'end = "1{" " * 2000}"': "figures.end = ",
    'end = "meen(u)"': "figures.end = 'meen(u)': 'meen' is neither a function nor a variable of the FMU; did you",
    'status = "u[-1]"': "figures.status: the results have another column of this name",
    'alpha_u = "u[-1]"': "figures.alpha_u: the results have another column of this name",
}
"""Entries of [figures]."""
WRONG = {
    **WHOLE,
    **{f"{HEAD}{key}\n{VARY}{TAIL}": message for key, message in HEADS.items()},
    **{f"{HEAD}[vary]\n{entry}\n{TAIL}": message for entry, message in VARIED.items()},
    **{f"{PLAN}{table}\n{TAIL}": message for table, message in TABLES.items()},
    **{f"{PLAN}[figures]\n{entry}\n": message for entry, message in FIGURES.items()},
}


def mistakes(plan: Path) -> list[str]:
    """Return the messages about a plan."""
    with pytest.raises(FileError) as refused:
        prepared(plan)
    return str(refused.value).splitlines()


@pytest.mark.parametrize(("text", "message"), WRONG.items(), ids=WRONG.values())
def test_a_mistake_is_a_line(text: str, message: str, tmp_path: Path, videoray_fmu: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    shutil.copy(videoray_fmu, tmp_path)
    first, *others = mistakes(plan)
    assert any(line.startswith(f"{plan}: {message}") for line in (first, *others))
    assert not (others and text.startswith(HEAD))


SAMPLES = {
    "alpha_u,m_rov\n1.0,6.5\n1.2,6.6\n": "",
    "": "design.csv: the file is empty",
    "alpha_u,alpha_u\n1.0,1.1\n": "design.csv, line 1, column 'alpha_u': this column occurs twice",
    "1.0,1.1\n1.0,1.1\n": "design.csv, line 1 = '1.0, 1.1': no header; these lines look like numbers",
    "alpha_u\n": "design.csv: no rows below the header",
    "alpha_u\nnan\n": "design.csv, line 2, column 'alpha_u' = 'nan': must be a finite number",
    "alpha_u\n1.0\n-1.0\n": "plan.toml: samples: alpha_u = -1.0: must be within 0 ... 1000",
    "alpha_uu\n1.0\n": "design.csv, line 1, column 'alpha_uu': the FMU has no variable 'alpha_uu'",
    "beta_u\n1.0\n": "plan.toml: samples: beta_u: is given in [set] or [inputs] too",
}
"""Tables of samples, and the end of the message about them."""


@pytest.mark.parametrize(("table", "message"), SAMPLES.items(), ids=SAMPLES.values())
def test_samples_give_a_run_for_each_row(table: str, message: str, tmp_path: Path, videoray_fmu: Path) -> None:
    shutil.copy(videoray_fmu, tmp_path)
    (tmp_path / "design.csv").write_text(table)
    plan = tmp_path / "plan.toml"
    head = HEAD.replace("runs = 4", 'samples = "design.csv"')
    plan.write_text(f"{head}set = {{ beta_u = 0.9 }}\n{TAIL}")
    if message:
        (line,) = mistakes(plan)
        assert message in line
        return
    study = prepared(plan)
    assert study.varied == ["alpha_u", "m_rov"]
    assert study.rows.tolist() == [[1.0, 6.5], [1.2, 6.6]]


@pytest.mark.parametrize("case", WRONG_PATHS)
def test_a_path_that_does_not_stay_in_the_folder_of_the_plan_is_refused(case: str, tmp_path: Path) -> None:
    name, message = WRONG_PATHS[case]
    plan = tmp_path / "here" / "plan.toml"
    (plan.parent / "tables").mkdir(parents=True)
    (tmp_path / "secrets").mkdir()
    for secret in ("secret", "secrets/model.png"):
        (tmp_path / secret).write_text("time,u_l\n0,0.123\n")
    (plan.parent / "link").symlink_to(tmp_path / "secret")
    (plan.parent / "links").symlink_to(tmp_path / "secrets", target_is_directory=True)
    keys = ("fmu", "vehicle", "system", "samples", "vary_from", "input_file.path")
    plan.write_text("".join(f'{key} = "{name}"\n' for key in keys) + HEAD.partition("\n")[2] + VARY + TAIL)
    lines = mistakes(plan)
    assert len(lines) == len(keys)
    for key, line in zip(keys, lines, strict=True):
        assert line.startswith(f"{plan}: {key} = ")
        assert message in line


def test_a_variable_takes_the_values_of_its_type_within_its_bounds(foreign: Callable[..., Path]) -> None:
    has = read_model(foreign()).variables
    assert [has["fast"].wrong(x) for x in (0.0, 1.0, 0.5)] == ["", "", "must be true or false, or 1 or 0"]
    assert [has["gain"].wrong(x) for x in (2.0, 0.5)] == ["", "must be a whole number"]
    assert (has["a"].wrong(10.0), has["a"].wrong(10.1)) == ("", "must be within -10 ... 10")


def test_mistakes_of_a_plan_and_then_with_its_fmu_are_reported_at_once_and_nothing_is_written(
    tmp_path: Path, videoray_fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(videoray_fmu, tmp_path / "videoray.fmu")
    tail = VARY + "[inputs]\nu_l = 1.5\n" + '[figures]\nend = "q[-1]"\n'
    for head, expected in (
        (HEAD.replace("1.0", "0.95").replace("runs = 4\n", ""), ["stop_time", "runs"]),
        (HEAD, ["inputs.u_l", "figures.end"]),
    ):
        (tmp_path / "plan.toml").write_text(head + tail)
        assert main(["study", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "results")]) == 2
        assert [line.split(":")[2].split()[0] for line in capsys.readouterr().err.splitlines()] == expected
    assert not (tmp_path / "results").exists()


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
        study = prepared(path)
        assert study.inputs["u"].tolist() == pytest.approx(values, abs=1e-12), text
