"""What every effect declares."""

import numpy as np
import pytest

from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.identify.effects.dead_band import DeadBand
from rov_fmu.identify.effects.delay import Delay
from rov_fmu.identify.effects.effect import Effect, Setting, with_effects
from rov_fmu.identify.effects.lag import Lag
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.effects.reverse import ReverseThrust
from rov_fmu.identify.recordings.recordings_fit import FittedEffect
from rov_fmu.model.layout import HEAVE, SURGE, Axis
from rov_fmu.report.findings import acting, verdict
from rov_fmu.tank.description import Requests
from rov_fmu.tank.recording import Recording
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

ROV = load_vehicle(SHIPPED["videoray"]).rov
TIME = np.linspace(0.0, 10.0, 100)


def recording(file: str, axis: Axis, **more: object) -> Recording:
    return Recording(file, axis, "velocity", TIME, np.ones(100), np.zeros(100), **more)  # type: ignore[arg-type]


SETTING = Setting(
    [recording("a.csv", SURGE), recording("b.csv", SURGE), recording("a.csv", HEAVE, beside={"psi": TIME})],
    ROV,
    known=["F_0_u"],
    requests=Requests(lag=("top",)),
)


@pytest.mark.parametrize("kind", EFFECTS)
def test_an_effect_has_words_limits_and_a_start_within_them(kind: str) -> None:
    assert acting(FittedEffect(kind, "a.csv", "m/s", 0.1, None, kept=True))
    assert verdict(FittedEffect(kind, "a.csv", "1", 0.1, None, kept=False)) == f"left at {EFFECTS[kind].neutral:g}"
    for effect in EFFECTS[kind].candidates(SETTING):
        low, high = effect.bounds(SETTING)
        assert low <= effect.begin <= high
        assert effect.prior(SETTING) > 0.0


def test_candidates_are_those_that_are_neither_known_nor_in_the_vehicle() -> None:
    found = [effect for kind in EFFECTS.values() for effect in kind.candidates(SETTING)]
    assert Lag("top") in found
    assert Lag("rear") not in found
    assert {Load("heave"), Delay("surge"), Delay("b.csv", "surge"), DeadBand("rear")} <= {*found}
    assert not any(isinstance(effect, Load) and "surge" in (effect.of, effect.axis) for effect in found), "it is known"


def test_effects_of_different_kinds_differ() -> None:
    effects: list[Effect] = [Load("heave"), Load("heave"), Delay("heave")]
    assert len({*effects}) == 2


@pytest.mark.parametrize(
    ("effect", "value", "expected"),
    [
        (Load("heave"), 0.5, {"F_0_w": 0.5}),
        (Load("b.csv", "surge"), 0.5, {}),
        (Lag("rear"), 0.3, {"T_rear": 0.3}),
        (DeadBand("top"), 0.04, {"c_0_top": 0.04}),
        (ReverseThrust("top"), 0.5, {"a_t_top_reverse": 0.5 * ROV["a_t_top"], "b_t_top_reverse": 0.5 * ROV["b_t_top"]}),
    ],
)
def test_an_effect_of_the_vehicle_sets_its_coefficients(
    effect: Effect, value: float, expected: dict[str, float]
) -> None:
    added = with_effects(ROV, {effect: value}).coefficients
    assert {name: added[name] for name in added.keys() - ROV.coefficients.keys()} == expected
