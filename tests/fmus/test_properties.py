"""An FMU of either version runs as in FMPy, by calls with addresses, and one that fails is one line with its reason."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path

import fmpy
import numpy as np
import pytest

from rov_fmu.fmus.fmu import Fmu
from rov_fmu.fmus.instance import RunError
from tests.often import often

_TIMES = np.linspace(0.0, 2.0, 21)


@often("seed", 1, 4, 20)
@pytest.mark.parametrize("fmi", ["", "3"])
def test_a_run_has_the_bits_of_one_in_fmpy(fmi: str, seed: int, request: pytest.FixtureRequest) -> None:
    """With drawn inputs and parameters, of which all variables are read."""
    path, drawn = request.getfixturevalue(f"videoray{fmi}_fmu"), np.random.default_rng(seed)
    fmu = Fmu.open(path)
    inputs = {name: drawn.uniform(-0.5, 0.5) for name, v in fmu.variables.items() if v.causality == "input"}
    start = {"m_rov": drawn.uniform(6.0, 7.0), "beta_r": drawn.uniform(0.5, 1.0), "psi": drawn.uniform(-3.0, 3.0)}
    found = fmu.run(np.linspace(0.0, 2.0, 17), inputs, [*fmu.variables], start)
    told = fmpy.simulate_fmu(
        str(path), stop_time=2.0, output_interval=0.125, start_values=inputs | start, output=[*fmu.variables]
    )
    assert {name for name in fmu.variables if not np.array_equal(found[name], told[name])} == set()


def test_inputs_are_held_from_each_time_to_the_next(foreign: Callable[..., Path]) -> None:
    """y' = (gain u - y)/0.5, with a whole number, and one that is true or false."""
    fmu = Fmu.open(foreign())
    u = np.where(_TIMES[:-1] < 0.95, 0.0, 0.5)
    found = fmu.run(_TIMES, {"u": u}, ["y", "gain", "fast"], {"gain": 3.0})
    expected = 1.5 * (1.0 - np.exp(-np.maximum(_TIMES - 1.0, 0.0) / 0.5))
    np.testing.assert_allclose(found["y"], expected, rtol=1e-12)
    assert (found["gain"].tolist(), found["fast"].tolist()) == ([3] * 21, [0] * 21)
    fast = fmu.run(_TIMES, {"u": u}, ["y"], {"gain": 3.0, "fast": 1.0})["y"]
    assert fast.tolist() == [0.0, *(3.0 * u)]


@pytest.mark.parametrize("step", [0.01, 0.05, 0.1])
def test_no_step_passes_the_end_by_rounding(step: float, foreign: Callable[..., Path]) -> None:
    """19.990000000000002 + 0.01 is more than 20, which an FMU has to refuse. The other steps keep their length."""
    times = step * np.arange(round(20.0 / step) + 1, dtype=np.float64)
    assert any(t + step > times[-1] for t in times[:-1])
    fmu = Fmu.open(foreign())
    found = fmu.run(times, {}, ["y"], {"mode": 10.0, "a": 1.0})["y"]
    np.testing.assert_allclose(found, 1.0 - np.exp(-times / 0.5), rtol=1e-12)


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        (1.0, "the step at 1 s: error; the FMU: the pump is blocked"),
        (2.0, "it ended its process: SIGABRT"),
        (4.0, "it needs more than 1 s"),
        (6.0, "setting the inputs at 0.1 s: discard"),
        (8.0, "initialization: error"),
    ],
)
def test_a_run_that_fails_or_does_not_return_is_one_line(
    mode: float, reason: str, foreign: Callable[..., Path]
) -> None:
    with pytest.raises(RunError) as error:
        Fmu.open(foreign()).run(_TIMES, {"u": np.linspace(0.1, 1.0, 20)}, ["y"], {"mode": mode, "a": 1.0}, 1.0)
    assert str(error.value) == reason


def test_a_library_that_gives_no_instance_is_one_line(foreign: Callable[..., Path]) -> None:
    with pytest.raises(RunError, match="no licence"):
        Fmu.open(foreign(3)).run(_TIMES, {}, ["y"])


def test_an_fmu_of_either_version_tells_the_same_about_its_variables(videoray_fmu: Path, videoray3_fmu: Path) -> None:
    two, three = (Fmu.open(path).variables for path in (videoray_fmu, videoray3_fmu))
    own = [
        [replace(v, reference=0, type="", dtype="") for name, v in has.items() if name != "time"]
        for has in (two, three)
    ]
    assert own[0] == own[1]
    assert [(two[name].minimum, two[name].maximum) for name in ("m_rov", "X_ext", "u_l")] == [
        (1e-3, 1e6),
        (-inf, inf),
        (-1.0, 1.0),
    ]
