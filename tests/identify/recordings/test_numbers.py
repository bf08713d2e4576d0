"""The errors of predictions, the selection of effects and the spread of fits, against numbers by hand."""

from dataclasses import replace
from math import inf, log, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import sensor_noise
from rov_fmu.identify.effects.dead_band import DeadBand
from rov_fmu.identify.effects.delay import Delay
from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.identify.effects.lag import Lag
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.effects.voltage import Voltage
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.recordings.held_out import HeldOut, _half, _lead, _windows, of_velocity
from rov_fmu.identify.recordings.output_error import _at_least, _counting
from rov_fmu.identify.recordings.prediction_errors import Errors, errors_of, joined
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit, count
from rov_fmu.identify.recordings.selection import earn_their_place, likely
from rov_fmu.identify.simulation.prepared import PreparedRecording, prepare
from rov_fmu.identify.together import Together
from rov_fmu.model.layout import HEAVE, SURGE, Axis
from tests.vehicles import VIDEORAY


def prepared(axis: Axis, quantity: str, time: Any, values: Any) -> PreparedRecording:
    return prepare(Recording("log.csv", axis, quantity, time, np.full(len(time), 0.3), np.asarray(values)), VIDEORAY)


# ---- Errors of predictions -------------------------------------------------------------------------------------------


def test_the_errors_of_a_velocity_and_of_the_position_that_it_covers() -> None:
    """The sensor tells 1 m/s and the model 1.5 m/s from the second sample on, so the position is off by 0.5 t."""
    time = np.arange(50) / 10.0
    noise = 0.001 * (-1.0) ** np.arange(50)
    data = prepared(SURGE, "velocity", time, 1.0 + noise)
    found = errors_of(data, np.full(50, 1.5) + noise, 10)
    sigma = sensor_noise(data.values)
    assert found["velocity"].predicted == pytest.approx(np.full(40, 0.5))
    assert found["velocity"].unchanged == pytest.approx(0.5 + noise[9] - noise[10:])
    assert found["velocity"].noise == pytest.approx(np.full(40, sigma))
    assert found["position"].predicted == pytest.approx(0.05 * np.arange(1, 41))
    assert found["position"].unchanged == pytest.approx(-0.1 * np.arange(1, 41), rel=1e-3)
    assert found["position"].noise == pytest.approx(sigma * 0.1 * np.sqrt(np.arange(1, 41)))


def test_the_errors_of_a_position_and_of_its_rate() -> None:
    time = np.arange(50) / 10.0
    data = prepared(HEAVE, "depth", time, 2.0 * time)
    found = errors_of(data, 3.0 * time, 10)
    assert found["position"].predicted == pytest.approx(time[10:])
    assert found["position"].unchanged == pytest.approx(2.7 - 2.0 * time[10:])
    assert found["velocity"].predicted == pytest.approx(np.ones(40))
    assert found["velocity"].unchanged == pytest.approx(np.ones(40)), "from the 3 m/s at the start to 2 m/s"


def test_errors_are_joined_and_those_of_ten_seconds_come_first() -> None:
    one, two = (Errors(np.full(n, 3.0), np.full(n, 5.0), np.full(n, 1.0)) for n in (2, 3))
    found = joined([{("10 s", "velocity"): one, ("whole recording", "velocity"): two}, {("10 s", "velocity"): two}])
    assert len(found["10 s", "velocity"].predicted) == 5
    assert of_velocity(found) is found["10 s", "velocity"]
    assert of_velocity({("whole recording", "velocity"): two}) is two
    assert found["10 s", "velocity"].rms == pytest.approx((3.0, 5.0, 1.0))
    assert one.explained == pytest.approx(1.0 - 8.0 / 24.0)
    barely = Errors(np.ones(1), np.array([sqrt(1.99)]), np.ones(1))
    assert np.isnan(barely.explained)


# ---- Parts of recordings ---------------------------------------------------------------------------------------------


def test_a_half_has_the_samples_before_or_from_a_time_on_and_eight_at_least() -> None:
    data = prepared(HEAVE, "depth", np.arange(20.0), np.arange(20.0) ** 2)
    (early,), (late,) = (_half([data], 9.0, later=later) for later in (False, True))
    assert (early.time.tolist(), late.time.tolist()) == ([*range(9)], [*range(9, 20)])
    assert [len(_half([data], 8.0, later=False)), len(_half([data], 7.0, later=False))] == [1, 0]


@pytest.mark.parametrize(
    ("missing", "seconds", "samples"),
    [(0, 5.0, 51), (25, 5.0, 26), (27, 5.0, 0), (0, 0.2, 3), (0, 0.1, 0), (1, 0.2, 0)],
)
def test_the_lead_of_a_prediction_has_half_of_its_samples_at_least(missing: int, seconds: float, samples: int) -> None:
    """At 10 Hz 5 s have 51 samples with both ends; three are the fewest."""
    data = prepared(HEAVE, "depth", np.arange(200) / 10.0, np.arange(200.0))
    later = data.part(data.time >= missing / 10.0 - 1e-9)
    assert _lead(later, 0.0, seconds) == samples


def test_predictions_of_ten_seconds_begin_every_ten_seconds() -> None:
    data = prepared(HEAVE, "depth", np.arange(600) / 10.0, np.arange(600.0))
    windows = [*_windows([data])]
    assert [window[0][0].time[0] for window in windows] == pytest.approx([0.0, 10.0, 20.0, 30.0, 40.0])
    assert all(len(part.time) == 150 and start == 51 for ((part, start),) in windows)
    long = prepared(HEAVE, "depth", np.arange(6300) / 10.0, np.arange(6300.0))
    assert len([*_windows([long])]) == 31, "evenly spaced, and no more than thirty intervals"


# ---- Selection -------------------------------------------------------------------------------------------------------


def analysis(extras: dict[Effect, tuple[float, float]], degrees: float = 1000.0) -> Any:
    """Return the analysis of a fit with these values and standard errors, which are independent of each other."""
    x = np.array([5.0, *(value for value, _ in extras.values())])
    gram = np.diag([1.0, *(error**-2.0 for _, error in extras.values())])
    return SimpleNamespace(
        model=SimpleNamespace(names=("a_d_w",), extras=tuple(extras)),
        x=x,
        gram=gram,
        meat=gram,
        degrees_of_freedom=degrees,
    )


@pytest.mark.parametrize(
    ("extra", "neutral", "least"),
    [
        (Load("heave"), 0.0, sqrt(6.63)),
        (Delay("heave"), 0.0, sqrt(6.63)),
        (Load("b.csv", "heave"), 0.0, sqrt(log(1000.0))),
        (DeadBand("top"), 0.0, sqrt(log(1000.0))),
    ],
)
def test_an_effect_must_be_significant(extra: Effect, neutral: float, least: float) -> None:
    """One of the axis at 1 %; one of many by the Bayesian criterion."""
    for factor, is_kept in ((1.01, True), (0.99, False)):
        kept, x = earn_their_place(analysis({extra: (neutral + factor * least * 0.1, 0.1)}))
        assert kept == ((extra,) if is_kept else ())
        assert x[0] == 5.0
        assert len(x) == 1 + is_kept


def test_few_independent_samples_count_as_eight() -> None:
    for factor, is_kept in ((1.01, True), (0.99, False)):
        kept, _ = earn_their_place(analysis({DeadBand("top"): (factor * sqrt(log(8.0)) * 0.1, 0.1)}, 2.0))
        assert bool(kept) == is_kept


def test_the_least_likely_effect_goes_first_and_the_others_move() -> None:
    """A load of a file and that of the axis are alike, so each seems insignificant beside the other."""
    both = analysis({Load("heave"): (0.2, 1.0), Load("b.csv", "heave"): (0.2, 1.0)})
    information = np.array([[1.0, 0.0, 0.0], [0.0, 100.0, 99.0], [0.0, 99.0, 100.0]])
    both.gram = both.meat = information
    kept, x = earn_their_place(both)
    assert kept == (Load("heave"),)
    assert x == pytest.approx([5.0, 0.2 + 0.2 * 99.0 / 100.0])


def test_a_value_that_stands_for_no_effect_goes() -> None:
    assert earn_their_place(analysis({DeadBand("top"): (-0.1, 1e-3)}))[0] == ()


def test_only_some_effects_keep_their_prior_in_the_last_fit() -> None:
    setting = Setting([Recording("a.csv", HEAVE, "depth", np.arange(9.0), np.ones(9), np.zeros(9))], VIDEORAY)
    extras = (Lag("top"), Voltage("top"))
    assert likely(extras, setting, all_of_them=True).tolist() == [0.5, 0.5]
    assert likely(extras, setting, all_of_them=False).tolist() == [inf, 0.5]


# ---- Fits ------------------------------------------------------------------------------------------------------------

NAMES = ("a_d_w",)


def fit_of(offs: list[float], of_fit: float, by_halves: bool = False) -> RecordingsFit:
    """Return a fit with a standard error of 1, and predictions by fits that are off, each with its standard error."""
    own = Estimate(NAMES, np.array([VIDEORAY["a_d_w"]]), np.ones((1, 1)), 100.0, 1.0)
    predictions: Any = tuple(
        SimpleNamespace(coefficients={"a_d_w": VIDEORAY["a_d_w"] + off}, errors_of_fit={"a_d_w": of_fit})
        for off in offs
    )
    held_out = HeldOut(predictions, by_halves)
    return RecordingsFit(HEAVE, VIDEORAY, own, own, (), (), lambda: held_out)


@pytest.mark.parametrize(
    ("offs", "of_fit", "spread"),
    [
        ([6.1, -6.1, 6.1], sqrt(5.0), 3.05),  # the variance of the difference is 5 - 1
        ([5.9, -5.9, 5.9], sqrt(5.0), None),
        ([2.2, -2.2, 2.2], 0.5, 2.2 / sqrt(0.5)),  # at least that of independent recordings, 1/(3 - 1)
        ([9.0, 9.0], sqrt(5.0), None),  # two recordings tell no spread
    ],
)
def test_recordings_disagree_beyond_three_times_what_chance_explains(
    offs: list[float], of_fit: float, spread: float | None
) -> None:
    found = fit_of(offs, of_fit).spread()
    assert found == ({} if spread is None else {"a_d_w": pytest.approx(spread)})
    assert fit_of(offs, of_fit, by_halves=True).spread() == {}


def test_a_disagreement_widens_the_errors() -> None:
    fit = fit_of([6.1, -6.1, 6.1], sqrt(5.0))
    widened = fit.widened()
    assert widened.disagreement == pytest.approx({"a_d_w": 3.05})
    assert widened.estimate.errors == pytest.approx({"a_d_w": 3.05})
    assert widened.together is fit.together
    result: Any = SimpleNamespace(recordings=widened, response=None, chosen="recordings")
    together = Together([], [result])
    assert together.error("a_d_w") == pytest.approx(3.05 * fit.together.as_normal().errors["a_d_w"])
    assert together.correlation("a_d_w", ["b_d_w"]) == {}


def test_counts_have_their_nouns() -> None:
    assert [count(n, what) for n, what in ((1, "force"), (2, "force"), (0, "entry"), (1, "entry"))] == [
        "1 force",
        "2 forces",
        "0 entries",
        "1 entry",
    ]


def test_a_search_seems_half_done_after_thirty_steps() -> None:
    told: list[tuple[str, float]] = []
    on_step = _counting([prepared(HEAVE, "depth", np.arange(20.0), np.arange(20.0))], lambda *of: told.append(of))
    for _ in range(30):
        on_step()
    assert [words for words, _ in told] == [f"recordings of heave, step {n}" for n in range(1, 31)]
    assert [share for _, share in told] == pytest.approx([n / (n + 30.0) for n in range(1, 31)])


def test_the_noise_is_at_least_a_millionth_of_the_range() -> None:
    data = prepared(HEAVE, "depth", np.arange(20.0), np.linspace(0.0, 4.0, 20))
    assert _at_least(0.0, data) == pytest.approx(4e-6)
    assert _at_least(0.1, data) == 0.1
    assert _at_least(0.0, replace(data, values=np.ones(20))) == 1e-12
