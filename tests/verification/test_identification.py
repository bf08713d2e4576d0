"""The ROV identification benchmark: scores of known numbers, each method on a small vehicle, and the loader."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from verification.identification import __main__ as command
from verification.identification.data import Split, split_of
from verification.identification.datasets import EXJOBB
from verification.identification.datasets.simulated import CALM, ROUGH, TINY, Simulated
from verification.identification.methods.identified import Identified
from verification.identification.protocol import BEGIN, Outcome, run
from verification.identification.scores import bands, numbers, scores

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


# ---- The command -----------------------------------------------------------------------------------------------------


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
