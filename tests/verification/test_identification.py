"""The ROV identification benchmark: scores of known numbers, each method on a small vehicle, and the loader."""

import subprocess
import sys
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from tests.commands import ROOT
from verification.identification import __main__ as command
from verification.identification.data import Recorded, Recording, Split, split_of
from verification.identification.datasets import EXJOBB, TAUV
from verification.identification.datasets.simulated import CALM, ROUGH, TINY, Simulated
from verification.identification.methods.identified import Identified
from verification.identification.methods.unchanged import ConstantVelocity, Unchanged
from verification.identification.protocol import BEGIN, Outcome, Predicted, ahead, run
from verification.identification.scores import bands, numbers, relative_errors, scores

HERE = [
    pytest.param(name, marks=pytest.mark.long if "Gaussian" in name else ())
    for name in command.METHODS
    if "Neural" not in name
]
"""The methods that are tested in this process. Of these, the Gaussian process takes longest."""


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Split:
    return split_of(TINY, None, tmp_path_factory.mktemp("tiny"))


@pytest.fixture(scope="module", params=HERE)
def outcome(request: pytest.FixtureRequest, split: Split) -> Outcome:
    if "Gaussian" in request.param:
        pytest.importorskip("sklearn", reason="this method needs the extra [identification] with sklearn")
    return run(command.make(request.param), split)


# ---- Scores ----------------------------------------------------------------------------------------------------------


def test_scores_are_those_computed_by_hand() -> None:
    found = bands(np.array([3.0, -4.0, 0.5, 0.0]), np.array([1.0, 2.5, 1.0, 1.0]))
    assert found["error"] == pytest.approx(2.5124689)  # the root of 25.25 / 4
    inside = found["inside_50"], found["inside_95"]
    assert inside == (0.5, 0.75), "|3| > 1.96, 4 < 4.9, 4 > 1.69, 0.5 < 0.674"
    assert found["width_50"] == pytest.approx(2.0 * 0.6744898 * 1.375)
    assert found["width_95"] == pytest.approx(2.0 * 1.9599640 * 1.375)


def test_samples_are_pooled_by_quantity_and_span(split: Split) -> None:
    (recording,) = split.test
    counts = recording.log.record.time >= recording.log.record.time[0] + BEGIN
    sensor = recording.log.record.sensor
    error = np.where(counts, 1.0 + sensor, 1e6)  # what is before the begin must not count
    made = [Predicted(recording, span, error, np.full(len(error), 0.6), counts) for span in (1.0, inf)]
    rows = scores(Outcome(Unchanged(), split, made, 7.0))
    expected = [
        (m.channel.quantity.name, span, 1.0 + n, float(n == 0), m.noise, 150, 7.0, split.edits[False])
        for span in (1.0, inf)
        for n, m in enumerate(recording.channels)
    ]  # 1 < 1.96 * 0.6 < 2
    columns = ["quantity", "span", "error", "inside_95", "noise", "samples", "seconds", "edits"]
    assert {*rows[columns].itertuples(index=False, name=None)} == {*expected}


def test_a_summary_is_relative_to_no_change() -> None:
    """The geometric mean of 1/2 and 2 is 1."""
    rows = pd.DataFrame(
        {
            "method": ["no change", "no change", "other", "other"],
            "quantity": ["depth", "heading", "depth", "heading"],
            "span": 1.0,
            "error": [2.0, 4.0, 1.0, 8.0],
        }
    )
    assert relative_errors(rows).loc["other", 1.0] == pytest.approx(1.0)


# ---- Methods ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_method_predicts_the_future_from_the_past_alone(outcome: Outcome) -> None:
    """The samples of the last span are changed: no prediction of an earlier sample or of this span changes."""
    recording, span = outcome.split.test[0], 5.0
    record = recording.log.record
    start = record.time[0] + BEGIN + 2.0 * span
    last = record.time >= start
    moved = replace(record, value=record.value + np.where(last, 0.3, 0.0))
    changed = replace(recording, log=replace(recording.log, record=moved))
    before, after = (outcome.method.predict(one, BEGIN, span) for one in (recording, changed))
    counted = (record.time >= record.time[0] + BEGIN) & (record.time < start + span - 1e-9)
    for one, other in zip(before, after, strict=True):
        assert np.abs(one - other)[counted].max() < 1e-9


def test_every_method_has_bands_around_a_finite_prediction(outcome: Outcome) -> None:
    for one in outcome.predictions:
        assert np.all(np.isfinite(one.error[one.counts]))
        assert np.all(one.deviation[one.counts] > 0.0)


def test_models_beat_no_change_and_ours_is_near_the_noise(outcome: Outcome, split: Split) -> None:
    own = scores(outcome)
    if outcome.method.uses_thrust:
        errors = relative_errors(pd.concat([own, scores(run(Unchanged(), split))]))
        assert (errors.loc[outcome.method.name] < 0.25).all()
    if outcome.method.name == "rov-fmu":
        rates = own[own.unit.str.endswith("/s")]
        assert (rates.error < 2.0 * rates.noise).all()
        assert (rates.inside_95 >= 0.85).all()
        known = numbers(outcome)
        assert len(known) == 10
        assert known.true.between(known.low, known.high).all()


@pytest.mark.long
def test_the_neural_ode_passes_the_tests_of_every_method() -> None:
    pytest.importorskip("jax", reason="this method needs the extra [identification] with jax")
    program = [sys.executable, "-m", "tests.verification.neural_ode_checks"]
    ran = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.stdout == "passed\n", ran.stderr


def test_no_change_and_constant_velocity_are_what_they_say(split: Split) -> None:
    recording = _ramp(split.test[0])
    values, _ = Unchanged().predict(recording, BEGIN, 1.0)
    moved, _ = ConstantVelocity().predict(recording, BEGIN, 1.0)
    record = recording.log.record
    heading = np.array([not s.is_velocity for s in record.sensors])[record.sensor]
    own = heading & (record.time >= record.time[0] + BEGIN)
    rate = 0.1 + 0.2 * (record.time[own] - record.time[0])  # the heading turns at 0.2 rad/s, as its rate says
    assert moved[own] == pytest.approx(rate, abs=1e-9)
    since = ahead(recording, 1.0)[own]
    assert values[own] == pytest.approx(rate - 0.2 * (since + 0.1), abs=1e-9), "the sample 0.1 s before the start"


class _Beside(Unchanged):
    """Predicts every sample 2 beside its value in the first second of a span, and 3 beside it later."""

    def predict(self, recording: Recording, begin: float, span: float) -> tuple[Array, Array]:  # noqa: ARG002
        values = recording.log.record.value
        return values + np.where(ahead(recording, span) < 1.0, 2.0, 3.0), np.zeros(len(values))


def test_bands_follow_the_errors_of_the_training_by_the_time_ahead(split: Split) -> None:
    (one,) = run(_Beside(), split, [5.0]).predictions
    expected = np.where(ahead(one.recording, 5.0) < 1.0, 2.0, 3.0)
    assert one.deviation[one.counts] == pytest.approx(expected[one.counts])
    assert np.abs(one.error[one.counts]) == pytest.approx(expected[one.counts]), "within half a turn for the heading"


def _ramp(recording: Recording) -> Recording:
    """A recording of a heading of 0.1 rad that grows by 0.2 rad/s, and of velocities of 0.2."""
    record = recording.log.record
    heading = np.array([not s.is_velocity for s in record.sensors])[record.sensor]
    value = np.where(heading, 0.1 + 0.2 * (record.time - record.time[0]), 0.2)
    return replace(recording, log=replace(recording.log, record=replace(record, value=value)))


# ---- Data ------------------------------------------------------------------------------------------------------------


def test_a_changed_file_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "a.csv").write_text("other", encoding="utf-8")
    known = Recorded("mine", "somebody/Somewhere", "", {"a": {"a.csv": 64 * "0"}})
    for data, reason in ((tmp_path, "has the SHA-256"), (tmp_path / "none", "there is no such file")):
        with pytest.raises(DataFileError, match=reason) as refused:
            known.write("training", data, tmp_path)
        assert len(str(refused.value).splitlines()) == 1
        assert "a.csv" in str(refused.value)


def test_the_right_one_of_two_files_with_the_same_name_is_taken(tmp_path: Path) -> None:
    for folder, text in (("a", "wrong"), ("b", "right")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "log.csv").write_text(text, encoding="utf-8")
    digest = "27042f4e6eca7d0b2a7ee4026df2ecfa51d3339e6d122aa099118ecd8563bad9"
    Recorded("mine", "somebody/Somewhere", "", {"a": {"log.csv": digest}}).write("training", tmp_path, tmp_path)
    assert (tmp_path / "log.csv").read_text(encoding="utf-8") == "right"


@pytest.mark.parametrize("known", [EXJOBB, TAUV], ids=lambda one: one.name)
def test_every_third_recording_is_for_the_test(known: Recorded) -> None:
    training, test = (known.of_part(part) for part in ("training", "test"))
    assert sorted([*training, *test]) == sorted(known.recordings)
    assert test == [*known.recordings][2::3]


# ---- The command -----------------------------------------------------------------------------------------------------


def test_an_unknown_data_set_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert command.main(["--only", "mine", "-o", str(tmp_path)]) == 2
    assert "--only mine: there is no such data set, only exjobb, tauv" in capsys.readouterr().err


def test_the_command_writes_the_scores(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(command, "DATA_SETS", [TINY, EXJOBB])
    monkeypatch.setattr(command, "METHODS", ["unchanged:Unchanged", "least_squares:LeastSquares"])
    monkeypatch.delenv("ROV_FMU_DATA", raising=False)
    assert command.main(["-o", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert "exjobb: not run, because --data is not given" in err
    assert "tiny: RMS error, SI units" in out
    written = pd.read_csv(tmp_path / "scores.csv")
    assert {*written.method} == {"no change", "least squares"}
    assert "<svg" in (tmp_path / "scores.svg").read_text(encoding="utf-8")
    monkeypatch.setattr(command, "METHODS", ["unchanged:Unchanged"])
    assert command.main(["--only", "tiny", "-o", str(tmp_path)]) == 0, "its rows are replaced"
    pd.testing.assert_frame_equal(
        pd.read_csv(tmp_path / "scores.csv").drop(columns="seconds"),
        written[written.method == "no change"].drop(columns="seconds"),
    )


@pytest.mark.parametrize(
    "known",
    [pytest.param(CALM, marks=pytest.mark.weekly), pytest.param(ROUGH, marks=pytest.mark.weekly)],
    ids=lambda one: one.name,
)
def test_our_bands_cover_on_the_simulated_vehicle(known: Simulated, tmp_path: Path) -> None:
    outcome = run(Identified(), split_of(known, None, tmp_path))
    assert scores(outcome).inside_95.mean() >= 0.85
    several = numbers(outcome)
    assert len(several) == 20
    assert several.true.between(several.low, several.high).sum() >= 18
