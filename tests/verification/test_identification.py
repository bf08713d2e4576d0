"""The identification benchmark: no prediction sees what it predicts, and our bands cover on a simulated vehicle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from verification.identification.__main__ import METHODS
from verification.identification.data import Split, split_of
from verification.identification.datasets.simulated import CALM, ROUGH, TINY, Simulated
from verification.identification.methods.identified import Identified
from verification.identification.protocol import BEGIN, Outcome, run
from verification.identification.scores import numbers, scores

pytestmark = pytest.mark.weekly


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Split:
    return split_of(TINY, None, tmp_path_factory.mktemp("tiny"))


@pytest.fixture(scope="module", params=METHODS)
def outcome(request: pytest.FixtureRequest, split: Split) -> Outcome:
    return run(request.param(), split)


def test_a_method_predicts_the_future_from_the_past_alone(outcome: Outcome) -> None:
    """The samples of the last span are changed: no prediction of an earlier sample or of this span changes."""
    log, span = outcome.split.test[0], 5.0
    record = log.record
    start = record.time[0] + BEGIN + 2.0 * span
    last = record.time >= start
    moved = replace(record, value=record.value + np.where(last, 0.3, 0.0))
    changed = replace(log, record=moved)
    before, after = (outcome.method.predict(one, BEGIN, span) for one in (log, changed))
    counted = (record.time >= record.time[0] + BEGIN) & (record.time < start + span - 1e-9)
    for one, other in zip(before, after, strict=True):
        assert np.abs(one - other)[counted].max() < 1e-9


@pytest.mark.parametrize("known", [CALM, ROUGH], ids=lambda one: one.name)
def test_our_bands_cover_on_the_simulated_vehicle(known: Simulated, tmp_path: Path) -> None:
    outcome = run(Identified(), split_of(known, None, tmp_path))
    assert scores(outcome).inside_95.mean() >= 0.85
    several = numbers(outcome)
    assert len(several) == 20
    assert several.true.between(several.low, several.high).sum() >= 18
