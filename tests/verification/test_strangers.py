"""The gate of strangers: its simulator obeys mechanics and the law, and its counts are those made by hand."""

import json
import re
from dataclasses import replace
from math import exp, log, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from verification.identification.strangers import __main__ as command
from verification.identification.strangers import gates
from verification.identification.strangers.drawn import HEADERS, Drawn, draw, kind_of
from verification.identification.strangers.fit import answers_of_fit
from verification.identification.strangers.judge import (
    Judged,
    JudgedAxis,
    Number,
    are_tested,
    logged_speeds,
    read,
)
from verification.identification.strangers.kinds import AS_MODELLED, BY_NAME, KINDS, STRANGERS, Kind
from verification.identification.strangers.water import (
    DRIVEN,
    HEAVE,
    ROW,
    SURGE,
    SWAY,
    YAW,
    Array,
    Water,
    answers,
    flown,
    step,
)

# ---- The simulator ---------------------------------------------------------------------------------------------------


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


def test_coriolis_and_munk_terms_do_no_work() -> None:
    """Without drag and load, the kinetic energy of a vehicle that turns while it moves stays."""
    body = replace(draw(5, 4, AS_MODELLED).body, quadratic=np.zeros(4), linear=np.zeros(4), load=0.0)
    y = np.zeros((16, 1))
    y[:4, 0] = 1.0, 0.5, 0.2, 2.0
    energies, water = [], Water(body)
    for _ in range(100):
        energies.append(float(np.sum(body.inertia * y[:4, 0] ** 2)))
        y = step(lambda _, y: water.rates(np.zeros(1), y, np.zeros((4, 1))), 0.0, y, 0.05)
    assert energies == pytest.approx([energies[0]] * 100, rel=1e-4)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_no_kind_gives_energy_to_a_vehicle_that_coasts(kind: Kind) -> None:
    body = replace(draw(5, 4, kind).body, load=0.0)
    y = np.zeros((16, 1))
    y[:4, 0] = 0.9, -0.4, 0.3, -1.5
    for state in range(4):
        y[12 + state] = y[state]
    energies, water = [], Water(body, kind.act)
    for _ in range(20):
        energies.append(float(np.sum(body.inertia * y[:4, 0] ** 2)))
        y = step(lambda _, y: water.rates(np.full(1, 9.0), y, np.zeros((4, 1))), 0.0, y, 0.05)
    assert np.all(np.diff(energies) < 0.0)


@pytest.mark.parametrize("axis", [SURGE, YAW])
def test_answers_are_those_in_closed_form(axis: int) -> None:
    drawn = draw(8, 2, AS_MODELLED)
    b, commands = drawn.body, [0.4, -0.7]
    arm = b.arm if axis == YAW else 1.0
    for command_, (V, rise, way) in zip(commands, drawn.truth(axis, commands).T.tolist(), strict=True):
        pair = DRIVEN[axis, :2] * command_
        F = abs(b.full * arm * float(np.sum(DRIVEN[axis, :2] * b.goal(pair))))
        lost = b.full * arm**2 * b.loss * abs(command_) * float(np.sum(b.directed(pair)))
        ratio, M = b.astern[axis] if command_ < 0.0 else 1.0, b.inertia[axis]
        a, c = ratio * b.quadratic[axis], ratio * b.linear[axis]
        speed = (sqrt((c + lost) ** 2 + 4.0 * a * F) - (c + lost)) / (2.0 * a)
        tau, _ = quad(lambda v, F=F, c=c + lost, a=a, M=M: M / (F - (c + a * v) * v), 0.0, (1.0 - exp(-1.0)) * speed)
        assert np.copysign(speed, command_) == pytest.approx(V, rel=1e-4)
        assert (rise, way) == pytest.approx((tau, M / a * log((a * speed + c) / (0.1 * a * speed + c))), rel=2e-3)


def test_a_load_against_the_command_has_no_answer() -> None:
    water = Water(replace(draw(8, 4, AS_MODELLED).body, load=-100.0))
    found = answers(water, HEAVE, DRIVEN[HEAVE][:, None] * np.array([0.3, -0.3]), 0.0)
    assert np.all(np.isnan(found[:, 0]))
    assert found[0, 1] < 0.0


# ---- The vehicles ----------------------------------------------------------------------------------------------------


def _rates(kind: Kind, random: np.random.Generator) -> Array:
    """Return the motion of a kind at some states and commands."""
    water = Water(replace(draw(5, 4, kind).body, coupled=True), kind.act)
    y, commands = random.uniform(-1.0, 1.0, (16, 50)), random.uniform(-1.0, 1.0, (4, 50))
    return water.rates(np.full(50, 40.0), y, commands)


@pytest.mark.parametrize("kind", STRANGERS, ids=lambda kind: kind.name)
def test_every_stranger_breaks_the_law(kind: Kind) -> None:
    random = np.random.default_rng(1)
    commands = random.uniform(-1.0, 1.0, (100, 4, 2))
    columns = {axis: random.uniform(-1.0, 1.0, (100, 2)) for axis in (SURGE, SWAY, HEAVE, YAW)}
    shown = {axis: values.copy() for axis, values in columns.items()}
    kind.shown(shown, random)
    with_law = _rates(replace(kind, act=AS_MODELLED.act), np.random.default_rng(2))
    differences = (
        not np.allclose(_rates(kind, np.random.default_rng(2)), with_law),
        not np.array_equal(kind.followed(commands), commands),
        any(not np.array_equal(shown[axis], values) for axis, values in columns.items()),
        kind.has_hidden_sway,
    )
    assert sum(differences) == 1


def test_kinds_take_turns_and_half_of_them_are_strangers() -> None:
    for count in (2, 4):
        kinds = [kind_of(seed, count) for seed in range(400, 460)]
        assert all((kind in STRANGERS) == (n % 2 == 0) for n, kind in enumerate(kinds))
        assert {kind.name for kind in KINDS if count in kind.counts} == {
            *(kind_of(seed, count).name for seed in range(100))
        }
    assert len(BY_NAME) == len(KINDS)


def _short(kind: Kind, rows: int = 60) -> Drawn:
    drawn = draw(11, 2, kind)
    return replace(drawn, commands=drawn.commands[15 : 15 + rows])


def test_the_best_fit_of_the_law_finds_the_truth_of_one_as_modelled_and_not_of_a_stranger() -> None:
    commands = [0.6, -0.6]
    for kind, low, high in ((AS_MODELLED, 0.0, 0.02), (BY_NAME["heavier"], 0.05, 1.0)):
        drawn = _short(kind)
        off = np.abs(np.log(answers_of_fit(drawn, SURGE, commands) / drawn.truth(SURGE, commands)))
        assert low <= off.max() <= high


def test_a_folder_is_the_same_each_time_and_one_seed_makes_one_folder(tmp_path: Path) -> None:
    for name, kind in (("a", AS_MODELLED), ("b", AS_MODELLED), ("c", BY_NAME["compass"])):
        _short(kind, 30).write(tmp_path / name)
    texts = [{p.name: p.read_text(encoding="utf-8") for p in (tmp_path / name).iterdir()} for name in "abc"]
    assert texts[0] == texts[1]
    assert {name for name in texts[0] if texts[0][name] != texts[2][name]} == {"dive_0.csv", "dive_1.csv"}


# ---- The judge -------------------------------------------------------------------------------------------------------


def test_what_was_reached_for_long_enough_is_tested() -> None:
    """100 rows ahead at 1 m/s, of which one at 2 m/s is no test; astern at 0.5 m/s."""
    speeds = np.array([*[1.0] * 99, 2.0, *[-0.5] * 20, *[0.0] * 500])
    truth, commands = np.array([0.9, -0.4, 1.02, -0.6, 1.9, np.nan]), np.array([0.3, -0.3, 0.5, -0.5, 1.0, -1.0])
    assert are_tested(truth, commands, speeds).tolist() == [True, True, True, False, False, False]
    assert not are_tested(truth, commands, np.zeros(9)).any()


def test_speeds_are_read_from_logs(tmp_path: Path) -> None:
    """A heading that turns by 20 degrees a second through north, with gaps, and a velocity of 0.5 m/s."""
    lines = [f"time [s],{HEADERS[SURGE]},{HEADERS[YAW]}"]
    lines += [f"{0.1 * n:.1f},{'' if n % 3 else 0.5},{(350.0 + 2.0 * n) % 360.0}" for n in range(100)]
    (tmp_path / "dive.csv").write_text("\n".join(lines), encoding="utf-8")
    assert logged_speeds(tmp_path, YAW) == pytest.approx(np.radians(20.0))
    assert logged_speeds(tmp_path, SURGE) == pytest.approx(0.5)
    assert not len(logged_speeds(tmp_path, HEAVE))


def _number(truth: float) -> Number:
    return Number(0.5, "V_ss", truth, 1.0, 0.9, 1.2)


def test_an_error_is_told_in_halves_of_the_interval_on_its_side() -> None:
    assert [_number(truth).off for truth in (1.0, 1.1, 1.4, 0.8)] == pytest.approx([0.0, 0.5, 2.0, 2.0])
    assert _number(1.0).half_width == pytest.approx(0.2)
    assert [JudgedAxis("surge", "good", 0.0, (_number(t),)).is_off for t in (1.29, 1.31, 0.86, 0.84)] == [
        False,
        True,
        False,
        True,
    ]


def _made(kind: str, *axes: tuple[str, float, float], causes: tuple[tuple[str, bool], ...] = ()) -> Judged:
    """Return a folder with axes by their word, the distance of the best fit, and the truth where 1.0 is told."""
    judged = (JudgedAxis("surge", word, distance, (_number(truth),)) for word, distance, truth in axes)
    return Judged("made", kind, 2, tuple(judged), causes, 10.0)


MADE = [
    _made("as modelled", ("good", 0.0, 1.0), ("usable", 0.0, 1.1)),
    _made("weak thruster", ("good", 0.0, 1.5), causes=(("health port", True), ("rotor lag", False))),
    _made("jets", ("good", 0.1, 2.0), ("good", 0.04, 1.0), ("do not use", 0.3, 9.0)),
    _made("play", ("usable", 0.06, 0.5), ("good", 0.2, 1.1)),
    _made("late velocity", ("good", 0.3, 2.0)),
]


def test_the_cause_of_each_fault_is_what_the_product_calls_it() -> None:
    told = ("health port", "rotor lag", "reversed commands stbd", "swapped commands port and stbd", "command limit")
    true = [[words for words in told if re.fullmatch(kind.causes, words)] for kind in KINDS if kind.causes != "-"]
    assert sorted(true) == sorted([words] for words in told)


def test_counts_are_those_made_by_hand() -> None:
    rows = {row[0]: row[2] for row in gates.gates([gates.stage("now", MADE)])}
    assert rows["*good* axes with a wrong answer"] == "2 of 5 (40 %)", "what no log can show is not counted"
    assert rows["*usable* axes with a wrong answer"] == "1 of 2 (50 %)"
    assert rows["the worst kind, *good* and *usable*"] == "jets: 1 of 1 (100 %)"
    assert rows["*good* of right models"] == "1 of 2 (50 %)"
    assert rows["*good* of strangers within 5 % of the fit"] == "1 of 1 (100 %)"
    assert rows["V_ss of right models, median"] == "±20.0 %"
    assert rows["true causes of those told with a probability"] == "1 of 2 (50 %)"
    kinds = {row[0]: row[2:] for row in gates.by_kind([gates.stage("now", MADE)])}
    assert kinds["jets"] == ("1, 1 off", "", "1, 1 off")
    assert kinds["play"] == ("1", "1, 1 off", "")
    assert kinds["coanda"] == ("", "", "")
    hidden = {row[0]: row[2:] for row in gates.by_kind([gates.stage("now", MADE)], hidden=True)}
    assert hidden == {"": ("now: good", "now: usable", "now: do not use"), "scaled velocity": ("", "", "")} | {
        "late velocity": ("1, 1 off", "", "")
    }


def test_a_line_has_all_of_a_folder_and_stages_stand_beside_each_other(tmp_path: Path) -> None:
    assert [read(one.line()) for one in MADE] == MADE
    path = tmp_path / "stages.jsonl"
    for name, some in (("before", MADE[:3]), ("after", MADE), ("before", MADE[:2])):
        gates.keep(gates.stage(name, some), path)
    heads, *rows = gates.gates(gates.stages(path))
    assert heads[2:] == ("before", "after")
    assert {row[2:] for row in rows if "folders" in row[0]} == {("2 and 0", "5 and 0")}


def test_the_command_judges_what_it_has_not_judged(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    asked = []

    def judged(seed: int, count: int) -> Judged:
        asked.append((seed, count))
        return replace(MADE[0], name=f"{count} axes, seed {seed}")

    monkeypatch.setattr(command, "judged", judged)
    output = tmp_path / "before.jsonl"
    for folders in ("2", "3"):
        assert command.main(["--seed", "7", "--folders", folders, "-o", str(output)]) == 0
    assert asked == [(7, 2), (8, 2), (9, 2)]
    assert [json.loads(line)["name"][-1] for line in output.read_text(encoding="utf-8").splitlines()] == ["7", "8", "9"]
    assert "*good* of right models" in capsys.readouterr().out


def test_what_cannot_be_judged_is_told_in_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "none").mkdir()
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "truth.json").write_text('{"answers": {"surge +30": 1}}', encoding="utf-8")
    (tmp_path / "other.jsonl").write_text('{"name": "mine"}\n', encoding="utf-8")
    for words, reason in (
        (["-o", str(tmp_path / "a.jsonl"), str(tmp_path / "none")], "neither it nor a folder in it has a truth.json"),
        (["-o", str(tmp_path / "a.jsonl"), str(tmp_path / "case")], "truth.json: its answers must be like"),
        (["-o", str(tmp_path / "other.jsonl")], "has other lines than this program writes"),
    ):
        assert command.main(words) == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1
        assert reason in lines[0]
