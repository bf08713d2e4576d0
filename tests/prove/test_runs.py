"""The runs of an FMU: every call in its order, beside the calls that the FMU itself writes down."""

import time
from pathlib import Path

import fmpy
import pytest
from pythonfmu import FmuBuilder

from rov_fmu.prove.runs import PlannedRun, Reaction, Runs
from rov_fmu.prove.subject import opened
from verification.references.fmpy_slave import keep_loaded

_SLAVE = """
import time
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real
from pythonfmu.enums import Fmi2Status

class Diary(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.u, self.n, self.y = 1.0, 0.0, 0, 0.0
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name, kind in (("u", Real), ("n", Integer)):
            setter = lambda value, name=name: (self.write(f"{name} = {value}"), setattr(self, name, value))
            self.register_variable(kind(name, causality=Fmi2Causality.input, setter=setter))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def write(self, words):
        with open("DIARY", "a") as file:
            file.write(f"{words}\\n")

    def setup_experiment(self, start, stop, tolerance):
        self.write(f"from {start} to {stop}, k = {self.k}")

    def enter_initialization_mode(self):
        self.write("enter")

    def exit_initialization_mode(self):
        self.write("exit")

    def terminate(self):
        self.write("terminate")

    def do_step(self, t, h):
        self.write(f"step {t} {h}")
        if h <= 0.0:
            self.log("never back", Fmi2Status.discard)
            self.log("all is well", Fmi2Status.ok)
            return False
        time.sleep(0.01 * self.k)
        self.y += self.k * self.u * h + self.n
        return True
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an FMU that writes its calls into a file."""
    path = tmp_path_factory.mktemp("diary")
    (path / "diary.py").write_text(_SLAVE.replace("DIARY", f"{path}/fmu/diary.txt"), encoding="utf-8")
    fmpy.extract(str(FmuBuilder.build_FMU(path / "diary.py", dest=path)), unzipdir=str(path / "fmu"))
    keep_loaded(path / "fmu")
    return path / "fmu"


def _diary(folder: Path) -> list[str]:
    """Return what the FMU has written since the last time."""
    path = folder / "diary.txt"
    lines = path.read_text(encoding="utf-8").splitlines()
    path.unlink()
    return lines


_PLAN = PlannedRun(1.0, ((2.0, {"u": 3.0, "n": 1.0}), (4.0, {"u": -1.0})), {"k": "2"}, ["y", "n"])


def test_a_run_sets_inputs_at_each_piece_and_ends_as_fmi_demands(folder: Path) -> None:
    found = Runs(str(folder)).run(_PLAN, 2)
    assert found.tolist() == [[0.0, 1.0], [4.0, 1.0], [8.0, 1.0], [7.0, 1.0], [6.0, 1.0]]
    assert _diary(folder) == [
        "from 1.0 to 4.0, k = 1.0",
        "enter",
        *("u = 3.0", "n = 1"),
        "exit",
        *("u = 3.0", "n = 1", "step 1.0 0.5", "step 1.5 0.5"),
        *("u = -1.0", "step 2.0 1.0", "step 3.0 1.0"),
        "terminate",
    ]


def test_both_versions_of_fmi_are_run_alike(videoray_dir: Path, videoray3_dir: Path) -> None:
    two, three = (Runs(str(folder)) for folder in (videoray_dir, videoray3_dir))
    plan = PlannedRun(
        0.0, ((1.0, {"u_l": 0.3}), (2.0, {"u_l": -0.5, "Z_ext": 1.0})), {"beta_r": "0.5"}, ["u", "w", "r"]
    )
    assert two.run(plan, 3).tolist() == three.run(plan, 3).tolist()
    for runs in (two, three):
        for length in (-1.0, 2.1):  # the stop time is 2 s
            assert runs.step_tried(plan, length).refused == 1
        refused = runs.values_tried(plan, [("m_rov", -1.0), ("beta_u", 0.5)])
        assert (refused.refused, refused.kept) == (1, 1)
        assert refused.words.startswith("discard: fmi")


def test_an_fmu_of_either_version_tells_the_same_about_itself(videoray_fmu: Path, videoray3_fmu: Path) -> None:
    for path in (videoray_fmu, videoray3_fmu):
        with opened(path) as subject:
            assert (subject.is_ours, subject.obstacle) == (True, "")
            assert subject.numbers("input") == ["u_l", "u_r", "u_t", "X_ext", "Z_ext", "N_ext", "V_N", "V_E"]
            assert subject.words == "the experiment manoeuvre (8 s)"


def test_the_time_of_steps_is_measured_until_it_is_up(folder: Path) -> None:
    """A step takes 0.02 s at least. Two runs of two steps are begun anew, and one of forty steps is not completed."""
    for steps, most in ((1, 0.12), (20, 0.03)):
        begun = time.perf_counter()
        found = Runs(str(folder)).durations(_PLAN, steps, most)
        assert min(found) >= 0.02
        assert sum(found) <= time.perf_counter() - begun
        assert len(found) <= 1.0 + most / 0.02
        times = [line.split()[1] for line in _diary(folder) if line.startswith("step")]
        assert times == (["1.0", "2.0"] * 4 if steps == 1 else ["1.0", "1.05", "1.1"])[: len(found)]


def test_an_answer_has_the_message_of_the_fmu_and_says_what_stayed(folder: Path) -> None:
    runs = Runs(str(folder))
    assert runs.step_tried(_PLAN, -1.0) == Reaction(1, 1, 1, "discard: never back")
    assert _diary(folder)[-2:] == ["step 1.0 -1.0", "terminate"]
    assert runs.step_tried(_PLAN, 1.0) == Reaction(1, 0, 0, "OK")
    assert _diary(folder)[-2:] == ["step 1.0 1.0", "terminate"]
    assert runs.values_tried(_PLAN, [("u", 7.0), ("u", 8.0)]) == Reaction(2, 0, 0, "OK")
    assert _diary(folder)[-4:] == ["exit", "u = 7.0", "u = 8.0", "terminate"]
    assert runs.values_tried(_PLAN, [("k", 7.0)]) == Reaction(1, 0, 0, "OK")
    assert _diary(folder)[-3:] == ["enter", "u = 3.0", "n = 1"], "parameters are set in the initialization"
