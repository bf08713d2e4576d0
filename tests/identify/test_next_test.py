"""The next test: within the limits of the tank, and none where enough is known."""

import re
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify import next_test as module
from rov_fmu.identify.identify import identify
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.next_test import REPEATED, NextTest, Sensor, next_test
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.report.console_results import print_identification
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import TankLimits
from rov_fmu.tank.findings import Finding
from tests.folders import FORCE, HEAD, MASS, SPEED, read
from tests.pool import run
from tests.vehicles import VIDEORAY


def estimate(axis: Axis, error: float) -> Estimate:
    """Return an estimate of drag and β with this relative standard error."""
    names = tuple(axis.coefficient(kind) for kind in ("a_d", "b_d", "beta"))
    values = np.array([VIDEORAY[name] for name in names])
    return Estimate(names, values, np.diag((error * values) ** 2), 1000.0, 1.0)


def proposed(axis: Axis, error: float = 0.2, noise: float = 0.01, **limits: float) -> NextTest:
    found = next_test(axis, VIDEORAY, estimate(axis, error), Sensor("velocity", noise), TankLimits(**limits))
    assert found
    return found


def steps(test: NextTest) -> tuple[list[float], float, float]:
    """Return the commands of a test, the duration of a hold and that of a rest, from its words."""
    levels = [float(level) / 100.0 for level in re.findall(r"(-?\d+)%", test.words)]
    hold, rest = re.findall(r"([0-9.]+) s (?:each|of rest)", test.words)
    return levels, float(hold), float(rest)


def plan(test: NextTest) -> list[tuple[float, float]]:
    levels, hold, rest = steps(test)
    return [(0.0, rest), *(part for c in levels for part in ((c, hold), (0.0, rest)))]


@pytest.mark.parametrize("axis", [SURGE, HEAVE], ids=lambda axis: axis.name)
def test_the_vehicle_stays_in_the_tank(axis: Axis) -> None:
    """The integrator of the tests flies the proposed steps, and a minute of coasting after them."""
    covered = {}
    for length in (np.inf, 3.0, 1.0):
        test = proposed(axis, **({"tank_length": length} if np.isfinite(length) else {}))
        flown = run(VIDEORAY, axis, [*plan(test), (0.0, 60.0)], 10.0)
        covered[length] = float(np.ptp(flown.position))
        assert covered[length] <= length
        assert test.is_useful
    assert covered[np.inf] > 3.0, "without limits the step is longer than the tank"


def test_yaw_needs_no_length() -> None:
    assert proposed(YAW, tank_length=0.1).words == proposed(YAW).words


@pytest.mark.parametrize("most", [0.15, 0.6])
def test_no_command_is_above_the_strongest(most: float) -> None:
    assert max(map(abs, steps(proposed(SURGE))[0])) > 0.6
    assert max(map(abs, steps(proposed(SURGE, command_max=most))[0])) <= most


@pytest.mark.parametrize("longest", [12.0, 30.0, 120.0])
def test_a_recording_is_no_longer_than_allowed(longest: float) -> None:
    assert sum(seconds for _, seconds in plan(proposed(HEAVE, duration=longest))) <= longest


def test_enough_is_known_where_intervals_are_narrow() -> None:
    assert proposed(HEAVE, error=0.02).is_known
    assert not proposed(HEAVE, error=0.03).is_known
    unknown = replace(estimate(HEAVE, 0.01), covariance=np.full((3, 3), np.inf))
    found = next_test(HEAVE, VIDEORAY, unknown, Sensor("velocity", 0.01))
    assert found
    assert not found.is_known


def test_no_test_is_of_use_where_none_fits_or_none_narrows() -> None:
    none = proposed(HEAVE, duration=2.0)
    assert (none.words, none.is_useful) == ("", False)
    blind = proposed(HEAVE, error=0.1, noise=10.0)
    assert blind.words
    assert not blind.is_useful


# ---- Forces ----------------------------------------------------------------------------------------------------------

THRUST = ("a_t_top", "b_t_top")


def uncertain_thrust(*errors: float) -> Estimate:
    """Return an estimate of the top thrust curve with these standard errors, N."""
    return Estimate(THRUST, np.array([VIDEORAY[name] for name in THRUST]), np.diag(errors) ** 2, 1000.0, 1.0)


@pytest.mark.parametrize("most", [1.0, 0.12])
def test_weak_forces_are_proposed_where_they_help_most(most: float) -> None:
    """The interval after them is that of least squares with the present estimate as a prior."""
    noise, limits = 0.05, TankLimits(command_max=most)
    found = next_test(HEAVE, VIDEORAY, uncertain_thrust(0.3, 0.5), Sensor("velocity", 10.0), limits, {"top": noise})
    assert found
    levels = [c for c in (0.05, 0.1, 0.15, 0.2) if c <= most]
    words = ", ".join(f"{c:.0%}" for c in levels)
    assert found.words == f"4 forces of the top thrust at each of {words}, ahead and in reverse"
    assert found.coefficient == "b_t_top"
    x = np.repeat(levels, 8)
    M = np.column_stack([x**2, x]) / noise
    after = np.linalg.inv(M.T @ M + np.diag([0.3**-2.0, 0.5**-2.0]))
    assert found.narrowed == pytest.approx(np.sqrt(after[1, 1]) / 0.5, rel=1e-6)


def test_forces_of_a_coarse_scale_are_not_proposed() -> None:
    found = next_test(HEAVE, VIDEORAY, uncertain_thrust(0.3, 0.5), Sensor("velocity", 0.001), scales={"top": 100.0})
    assert found
    assert "recording of" in found.words


def test_a_linear_part_near_zero_need_not_be_known_to_a_share_of_itself() -> None:
    """It is compared with a tenth of the quadratic part at full command."""
    for key, full in (("b_t_top", VIDEORAY["a_t_top"]), ("b_d_w", None)):
        k = VIDEORAY.replaced({key: 0.0})
        size = 0.1 * (full or VIDEORAY["a_d_w"] * k.response(HEAVE, 1.0)[0])
        for share, known in ((0.04, True), (0.06, False)):
            estimate = Estimate((key,), np.zeros(1), np.array([[(share * size / 1.96) ** 2]]), 1e6, 1.0)
            found = next_test(HEAVE, k, estimate, Sensor("velocity", 0.01))
            assert found
            assert found.is_known is known


# ---- The steps -------------------------------------------------------------------------------------------------------


def offered(
    monkeypatch: pytest.MonkeyPatch, axis: Axis = HEAVE, rov: Rov = VIDEORAY, **limits: float
) -> dict[str, Array]:
    """Return the commands of every recording that is considered, by its words."""
    found: dict[str, Array] = {}

    def informed(*of: object) -> Array:
        command = of[-1]
        assert isinstance(command, np.ndarray)
        words = next(words for words, c in recordings if c is command)
        found[words] = command
        return np.zeros((3, 3))

    recordings = [*module._recordings(axis, rov, TankLimits(**limits))]
    monkeypatch.setattr(module, "_recordings", lambda *_: iter(recordings))
    monkeypatch.setattr(module, "_information", informed)
    next_test(axis, rov, estimate(axis, 0.2), Sensor("velocity", 0.01), TankLimits(**limits))
    return found


def test_steps_of_all_sizes_last_four_time_constants(monkeypatch: pytest.MonkeyPatch) -> None:
    found = offered(monkeypatch, command_max=0.45)
    expected = {}
    for level in (0.1, 0.2, 0.3, 0.4, 0.45):
        longest = float(np.clip(round(4.0 * VIDEORAY.response(HEAVE, level)[1]), 5.0, 60.0))
        for ways, step in (((level,), "a step"), ((level, -level), "steps")):
            both = " and ".join(f"{c:.0%}" for c in ways)
            words = (
                f"a recording of {step} from rest at {both}, {longest:g} s each, with {longest:g} s of rest after each"
            )
            parts = [np.zeros(round(10.0 * longest))]
            for c in ways:
                parts += [np.full(round(10.0 * longest), c), np.zeros(round(10.0 * longest))]
            expected[words] = np.concatenate(parts)
    assert {*found} == {*expected}
    for words, command in found.items():
        assert command.tolist() == expected[words].tolist(), words


@pytest.mark.parametrize(("mass", "hold"), [(1e-3, "5 s each"), (1e4, "60 s each")])
def test_no_hold_is_shorter_than_5_s_or_longer_than_a_minute(
    mass: float, hold: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert all(hold in words for words in offered(monkeypatch, rov=VIDEORAY.replaced({"m_rov": mass})))


@pytest.mark.parametrize(
    ("duration", "hold", "rest"),
    [(24.0, 8, 8), (23.9, 4, 8), (20.0, 4, 8), (19.9, 4, 4), (12.0, 4, 4), (10.0, 2, 2), (5.9, 1, 1), (2.9, 0, 0)],
)
def test_holds_become_shorter_before_rests_do(
    duration: float, hold: int, rest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At a time constant of 2 s a step of 8 s has rests of 8 s, unless a recording must be shorter."""
    slow = VIDEORAY.replaced({"m_rov": VIDEORAY["m_rov"] * 2.0 / VIDEORAY.response(HEAVE, 1.0)[1]})
    found = offered(monkeypatch, rov=slow, duration=duration)
    of_full = [words for words in found if "a step from rest at 100%" in words]
    words = f"a recording of a step from rest at 100%, {hold} s each, with {rest} s of rest after each"
    assert of_full == [words] * (hold > 0)


@pytest.mark.parametrize(("longer", "hold"), [(1.001, 5), (0.999, 2)])
def test_the_tank_is_as_long_as_the_vehicle_goes(longer: float, hold: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The distance of a step at full command and a minute of coasting is that of the exact motion at 10 Hz."""
    flown = run(VIDEORAY, HEAVE, [(0.0, 5.0), (1.0, 5.0), (0.0, 65.0)], 10.0)
    covered = float(np.sum(flown.velocity)) / 10.0
    found = offered(monkeypatch, tank_length=longer * covered)
    (words,) = (words for words in found if "a step from rest at 100%" in words)
    assert f"{hold} s each" in words


def test_nothing_is_proposed_where_the_thrusters_do_not_push_both_ways() -> None:
    dead = VIDEORAY.extended({"c_0_top": 1.0})
    assert next_test(HEAVE, dead, estimate(HEAVE, 0.2), Sensor("velocity", 0.01)) is None
    nothing = Estimate((), np.zeros(0), np.zeros((0, 0)), 1.0, 1.0)
    assert next_test(HEAVE, VIDEORAY, nothing, Sensor("velocity", 0.01)) is None


@pytest.mark.parametrize("present", [0.2, inf])
def test_an_interval_after_a_recording_is_that_of_least_squares(present: float) -> None:
    """The derivatives are differences of the exact motion; the unknown velocity at the start is fitted too.

    A coefficient that is not identifiable yet is taken as uncertain by a factor of a thousand.
    """
    value, noise, name = VIDEORAY["beta_w"], 0.02, "beta_w"
    found = next_test(
        HEAVE,
        VIDEORAY,
        Estimate((name,), np.array([value]), np.array([[(present * value) ** 2]]), 1000.0, 1.0),
        Sensor("velocity", noise),
        TankLimits(duration=30.0),
    )
    assert found
    moved = [run(VIDEORAY.replaced({name: value * f}), HEAVE, plan(found), 10.0).velocity for f in (1.001, 0.999)]
    by_log = (moved[0] - moved[1]) / 0.002 / noise
    n = round(10.0 * plan(found)[0][1])
    w = VIDEORAY["b_d_w"] * value / VIDEORAY["m_rov"]  # while it rests, a small velocity falls by linear drag alone
    by_start = np.exp(-w * np.arange(len(by_log)) / 10.0) / noise
    by_start[n:] = 0.0
    gained = float(by_log @ by_log)
    before = min(present, 1000.0) ** -2.0
    assert found.narrowed == pytest.approx(np.sqrt(before / (before + gained)), rel=0.02)
    assert found.width == (inf if present == inf else pytest.approx(1.962 * present, rel=1e-3))
    assert (found.interval is None) == (present == inf)


@pytest.mark.parametrize(("narrowed", "is_useful"), [(0.9, True), (0.91, False)])
def test_a_test_is_useful_that_narrows_by_a_tenth(narrowed: float, is_useful: bool) -> None:
    test = replace(proposed(HEAVE), narrowed=narrowed)
    assert test.is_useful == is_useful
    assert replace(test, interval=(1.0, 2.0), width=0.05).is_known
    assert not replace(test, interval=(1.0, 2.0), width=0.051).is_known


# ---- In a folder -----------------------------------------------------------------------------------------------------

TESTS = {
    "thrust_top.csv": f"{FORCE}\n0.1,0.07\n0.3,0.6\n0.5,1.65\n0.7,3.2\n",
    "steady_heave.csv": f"{SPEED}\n0.3,0.163\n0.4,0.22\n0.5,0.28\n0.6,0.34\n0.7,0.4\n",
}


def test_the_printout_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = identify(read(tmp_path, f"{HEAD}[known]\n{MASS}[limits]\ntank_length = 2\nduration = 60.0\n", TESTS))
    (result,) = found.axes
    test = result.next_test
    assert test
    assert sum(seconds for _, seconds in plan(test)) <= 60.0
    known = replace(test, interval=(1.0, 1.02), width=0.02)
    useless = replace(test, words="", narrowed=1.0, repeat=True)
    useful = replace(test, coefficient="a_d_w", interval=(10.0, 20.0), width=0.5, narrowed=0.25, words="a dive")
    none = "To measure next: no step within the limits would narrow an interval by a tenth"
    for shown, expected in (
        (useful, "To measure next: heave: a dive (narrows a_d_w by 75%)."),
        (replace(useful, interval=None, width=inf), "To measure next: heave: a dive (determines a_d_w)."),
        (known, "Enough is known of heave."),
        (useless, f"{none}; the widest is that of {test.coefficient}. In heave: {REPEATED}."),
    ):
        print_identification(replace(found, axes=(replace(result, next_test=shown),)))
        assert f"\n{expected}\n" in capsys.readouterr().out
    warned = (Finding("unexplained", axis="heave", file="a.csv", names={"cause": "drift"}, numbers={"start": 0.0}),)
    print_identification(replace(found, axes=(replace(result, next_test=useful),), findings=warned))
    assert "\nTo measure next, once the warnings are settled: heave: a dive" in capsys.readouterr().out


def test_a_step_is_repeated_where_something_drifts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for axis, repeat in (("surge", False), ("heave", True)):
        drift = Finding("unexplained", axis=axis, file="log.csv", names={"cause": "drift"}, numbers={"start": 0.0})
        monkeypatch.setattr("rov_fmu.identify.identify.check_slips", lambda *_, drift=drift: [drift])
        (result,) = identify(read(tmp_path / axis, f"{HEAD}[known]\n{MASS}", TESTS)).axes
        assert result.next_test
        assert result.next_test.repeat == repeat


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("tank_length = 0", "limits.tank_length = 0: must be the length of the tank in m, above 0"),
        ('tank_length = "4 m"', "limits.tank_length = '4 m': must be a number"),
        (
            "command_max = 50",
            "limits.command_max = 50: must be above 0 and at most 1, a fraction of the full command: half is",
        ),
        ('command_max = "120 %"', "limits.command_max = '120 %': must be above 0 and at most 1"),
        ("duration = -1.0", "limits.duration = -1.0: must be the duration of a test in s, above 0"),
        ("tank_lenght = 3.0", "limits.tank_lenght"),
    ],
)
def test_a_wrong_limit_is_one_line(line: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(Exception, match="limits") as error:
        read(tmp_path, f"{HEAD}[known]\n{MASS}[limits]\n{line}\n", TESTS)
    text = str(error.value)
    assert text.count("\n") == 0
    assert message in text


def test_percent_are_a_fraction(tmp_path: Path) -> None:
    tests = read(tmp_path, f'{HEAD}[known]\n{MASS}[limits]\ncommand_max = "60 %"\n', TESTS)
    assert tests.given.description.tables.limits == TankLimits(command_max=0.6)
