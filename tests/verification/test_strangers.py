"""The gate of strangers: its simulator obeys the law, its faults are in the dives, and its counts are kept apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.identify.beginning import load_tests
from verification.identification.strangers import gates
from verification.identification.strangers.drawn import draw
from verification.identification.strangers.judge import Judged, JudgedAxis, Number, judged
from verification.identification.strangers.kinds import AS_MODELLED, BY_NAME
from verification.identification.strangers.water import ROW, Array, flown


def test_a_vehicle_as_modelled_moves_as_the_law_written_out() -> None:
    """The law in scalars, integrated by DOP853 between the rows, is an independent truth."""
    drawn = draw(3, 4, AS_MODELLED)
    b, commands = drawn.body, np.array([[0.6, 0.2, -0.5, 0.4], [0.6, 0.2, -0.5, 0.4], [-0.3, 0.5, 0.5, 0.0]])
    rows = np.repeat(commands, [5, 5, 10], axis=0)

    def rates(_: float, y: Array, c: Array) -> list[float]:
        u, v, w, r, _, _, _, psi, *F = y
        Mu, Mv, Mw, Ir = b.inertia
        advance = (u + b.arm * r, u - b.arm * r, v, w)
        T = []
        goals = []
        for force, asked, along in zip(F, c, advance, strict=True):
            beyond = max(abs(asked) - b.dead_band, 0.0) / (1.0 - b.dead_band)
            direction, sign = (b.reverse, -1.0) if asked < 0.0 else (1.0, 1.0)
            goals.append(sign * direction * beyond**2)
            T.append(b.full * (force - b.loss * abs(asked) * direction * along))
        X, Y, Z, N = T[0] + T[1], T[2], T[3] + b.load, b.arm * (T[0] - T[1])
        D = [
            (b.astern[n] if x < 0.0 else 1.0) * (b.quadratic[n] * abs(x) + b.linear[n]) * x
            for n, x in enumerate((u, v, w, r))
        ]
        moved = [u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), w, r]
        pushed = [(X - D[0] + Mv * v * r) / Mu, (Y - D[1] - Mu * u * r) / Mv, (Z - D[2]) / Mw]
        turned = (N - D[3] + (Mu - Mv) * u * v) / Ir
        return [*pushed, turned, *moved, *((goal - force) / b.lag for goal, force in zip(goals, F, strict=True))]

    y = np.zeros(12)
    y[6:8] = 2.0, 0.3
    for row in rows[:-1]:
        y = solve_ivp(rates, (0.0, ROW), y, "DOP853", args=(row,), rtol=1e-9, atol=1e-11).y[:, -1]
    found = flown(drawn.water, rows[:, :, None], np.zeros(1), np.array([0.3]), 2.0)
    assert found[-1, :12, 0] == pytest.approx(y, rel=1e-4, abs=1e-4)


def test_the_bench_tests_a_whole_thruster_and_nobody_measures_one_without_a_table(tmp_path: Path) -> None:
    weak, whole, assumed = (draw(7, 2, BY_NAME[name]) for name in ("weak thruster", "as modelled", "weak, no table"))
    assert np.array_equal(weak.water.bench(np.array([0.5, -0.5])), whole.water.bench(np.array([0.5, -0.5])))
    assert abs(weak.motion[:, 3] - whole.motion[:, 3]).max() > 0.1, "it turns"
    for drawn, name in ((weak, "table"), (assumed, "none")):
        drawn.write(tmp_path / name)
    assert (tmp_path / "table" / "thrust_main.csv").exists()
    assert not (tmp_path / "none" / "thrust_main.csv").exists()
    assert f"about = {0.95 * assumed.body.full:.4g}" in (tmp_path / "none" / "rov.toml").read_text(encoding="utf-8")


def test_places_beside_those_of_the_file_turn_the_vehicle_and_a_cut_log_is_read_in_two(tmp_path: Path) -> None:
    given, moved, cut = (draw(7, 4, BY_NAME[name]) for name in ("as modelled", "places", "cut"))
    effects, others = given.body.places, moved.body.places
    assert np.array_equal(others[:3], effects[:3])
    assert others[3] == pytest.approx([1.02 * effects[3, 0], 1.02 * effects[3, 1], 0.005, 0.0])
    for drawn, name in ((given, "given"), (moved, "moved"), (cut, "cut")):
        drawn.write(tmp_path / name)
    told = [(tmp_path / name / "rov.toml").read_text(encoding="utf-8") for name in ("given", "moved")]
    assert told[0] == told[1]
    logs = load_tests(tmp_path / "cut").folder.logs
    assert [log.file.partition(" (from")[0] for log in logs] == ["dive_0.csv"] * 2 + ["dive_1.csv"] * 2


@pytest.mark.parametrize("name", ["lost lock", "frame of the earth", "unsettled velocity"])
def test_a_sensor_that_is_wrong_for_a_while_is_right_in_between(name: str) -> None:
    wrong, right = draw(8, 2, BY_NAME[name]), draw(8, 2, AS_MODELLED)
    off = abs(wrong.columns[0] - right.columns[0]) > 1e-6
    assert 0.05 < off.mean() < 0.4
    assert np.array_equal(wrong.columns[3], right.columns[3])


def test_a_wrong_answer_counts_for_its_kind_and_its_quantity_and_not_among_what_the_law_fits() -> None:
    inside = Number(0.3, "V_ss", 1.01, 1.0, 0.98, 1.02)
    late = Number(0.3, "time", 1.2, 1.0, 0.9, 1.1)
    right = JudgedAxis("surge", "good", 0.0, (inside,))
    wrong = replace(right, distance=0.2, numbers=(inside, late))
    folders = [
        Judged("a", "as modelled", 2, (right, right), (), 5.0),
        Judged("b", "weak thruster", 2, (right,), (("weak thruster port", True), ("rotor lag", False)), 5.0),
        Judged("c", "crisis", 2, (wrong, replace(wrong, word="usable")), (("command limit", False),), 5.0),
        Judged("d", "crisis", 2, (wrong,), (), 5.0),
    ]
    stage = gates.stage("now", folders)
    assert gates.broken(stage) == ["too many *good* axes of strangers are wrong"]
    assert gates.broken(gates.stage("now", folders[:2])) == []
    spoiled = replace(folders[0], axes=(replace(right, numbers=(late,)), replace(right, word="usable")))
    assert [words.partition(" a")[0] for words in gates.broken(gates.stage("now", [spoiled]))] == [
        "too many *good*",
        "too few",
        "too few",
    ]
    rows = {words: cell for words, _, cell in gates.gates([stage])}
    assert rows["*good* axes that the law fits, with a wrong answer"] == "0 of 3 (0 %)"
    assert rows["*good* axes of strangers, with a wrong answer"] == "2 of 2 (100 %)"
    assert rows["their *usable* axes with one"] == "1 of 1 (100 %)"
    assert rows["kinds with two such *good* axes"] == "crisis"
    assert rows["true causes of those told, but for a lag"] == "1 of 2 (50 %)"
    assert rows["vehicles with a fault whose cause is told"] == "1 of 1 (100 %)"
    assert rows["answers of right models inside; median error in half-widths"] == "2 of 2 (100 %), 0.50"
    assert {row[0]: row[2:] for row in gates.by_kind([stage])}["crisis"] == ("2, off: 2 time", "1, off: 1 time", "")


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("seed", "surge", "yaw", "causes"),
    [
        (9230009, "good", "good", 2),
        (9230010, "usable", "usable", 0),
        (9230028, "do not use", "do not use", 0),
    ],
    ids=[
        "a velocity jumps as it grows",
        "R2 alone shows wrong times",
        "no cause explains",
    ],
)
def test_of_a_stranger_only_what_is_true_is_said(seed: int, surge: str, yaw: str, causes: int) -> None:
    one = judged(seed, 2)
    assert {axis.axis: axis.word for axis in one.axes} == {"surge": surge, "yaw": yaw}
    assert [is_true for _, is_true in one.causes] == [True] * causes
    assert not any(axis.is_off() for axis in one.axes if axis.word == "good")


@pytest.mark.weekly
def test_a_right_model_is_good_and_nothing_is_answered_beyond_a_limit_of_the_commands() -> None:
    """In heave alone. The vehicle file goes on beyond the limit of 45 %, and the thrusters do not."""
    for kind, within, most, causes in (("as modelled", 0.5, 1.0, ()), ("limit", 0.3, 0.45, (("command limit", True),))):
        one = judged(1, 1, kind)
        (axis,) = one.axes
        answered = {number.command for number in axis.numbers}
        assert {within, -within} <= answered
        assert max(map(abs, answered)) <= most
        assert axis.word == "good"
        assert not axis.is_off()
        assert one.causes == causes


@pytest.mark.weekly
@pytest.mark.parametrize(("kind", "seed"), [("of 2 kg", 1), ("of 100 kg", 1), ("waves", 2)])
def test_vehicles_of_other_sizes_are_good_and_one_in_waves_is_not(kind: str, seed: int) -> None:
    one = judged(seed, 4, kind)
    assert len(one.axes) == 4
    assert not one.causes
    assert {axis.word == "good" for axis in one.axes} == {kind != "waves"}
    assert not any(axis.is_off() for axis in one.axes)


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("kind", "count"),
    [("late commands", 2), ("current", 4), ("slow noise", 2), ("jitter", 2), ("coarse depth", 1), ("coarse depth", 4)],
)
def test_a_right_model_in_an_imperfect_log_is_of_use_and_right(kind: str, count: int) -> None:
    for seed in (11, 12):
        one = judged(seed, count, kind)
        assert not one.error
        assert {axis.word for axis in one.axes} <= {"good", "usable"}
        assert not any(axis.is_off() for axis in one.axes)
        assert all(is_true for _, is_true in one.causes)
