"""The parameters: their priors, and how they enter the model."""

import ast
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import exp
from pathlib import Path

import numpy as np
import pytest

import rov_fmu
from rov_fmu import identify
from rov_fmu.equation.catalogue import HEAVE, SURGE
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.kinds import KINDS
from rov_fmu.identify.likelihood.parameters import Table, table_of
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.vehicle.vehicle import Vehicle, without_surface
from tests.folders import HEAD, folder_of, pulled
from tests.identify.conftest import add_voltage
from tests.recordings import run, write_log
from tests.vehicles import VIDEORAY

PHYSICS = ("kinds.py", "parameters.py", "hypotheses.py")
"""What declares the kinds, and what they do to the model."""
Known = tuple[Table, list[SampledLog]]


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Known:
    """Return the parameters of logs of heave (10 Hz) and surge (5 Hz) with a voltage, and of the forces of `top`."""
    rov = f'base = "videoray"\n{HEAD}[fit]\nvoltage = true\n'
    path = folder_of(tmp_path_factory.mktemp("tests"), rov, {"thrust_top.csv": pulled(6.0, 2.0)})
    for axis, rate, quantity in ((HEAVE, 10.0, "depth"), (SURGE, 5.0, "distance")):
        recording = run(VIDEORAY, axis, ((0.0, 2.0), (0.4, 5.0), (-0.5, 4.0)), rate)
        file = write_log(path, "0", recording.noisy(np.random.default_rng(0), quantity))
        add_voltage(file)
    beginning, logs, rows_of_tables = begin(load_tests(path))
    return table_of(beginning, logs, sorted({row.noise for row in rows_of_tables})), logs


def test_where_effects_are_absent_the_prior_means_are_the_base(known: Known) -> None:
    """Each effect can be absent and as large as usual, and what only a hypothesis frees stays absent without it."""
    table, _ = known
    z = np.array([p.mean if p.null is None else p.null for p in table.parameters])
    coefficients = table.coefficients(z)
    base = {**VIDEORAY.coefficients, "a_t_top": 6.0, "b_t_top": 2.0}  # its forces were measured
    assert {name: coefficients[name] for name in base} == pytest.approx(base, rel=2e-4)
    for p in table.parameters:
        assert p.deviation > 0.0, p.key
        assert all(p.low <= value <= p.high for value in (p.mean, p.null) if value is not None), p.key
        assert not p.is_fixed or p.mean == (p.null or 0.0), p.key


OVER_GROUND = ("velocity to the north", "velocity to the east")


@pytest.mark.parametrize(
    ("name", "quantities", "wanders", "scales", "offsets"),
    [
        ("dive", ("surge velocity", "depth", "heading"), False, (), ()),
        ("dive", ("surge velocity", "surge distance"), False, ("surge",), ("surge velocity",)),
        ("dive", ("surge velocity", "surge distance", "heading"), True, ("surge",), OVER_GROUND),
        ("dive", ("heave velocity", "depth", "surge velocity"), False, ("heave",), ("heave velocity",)),
        ("dive", ("yaw velocity", "heading"), False, ("yaw",), ("yaw velocity",)),
        ("log_heave", ("depth", "velocity"), False, ("heave",), ("heave velocity",)),
        ("log_surge", ("distance", "velocity"), False, ("surge",), ()),
        ("log_surge", ("velocity",), False, (), ()),
    ],
)
def test_a_velocity_has_a_scale_and_an_offset_where_a_position_shows_the_same_motion(
    name: str, quantities: Sequence[str], wanders: bool, scales: Sequence[str], offsets: Sequence[str], tmp_path: Path
) -> None:
    """In a tank, a current moves the distance, and not the velocity. The offset of an estimator is in the earth frame.

    They are what the filter reads, beside sensors that have neither.
    """
    random, file = np.random.default_rng(0), f"{name}.csv"
    inputs = ["u_l [1]", "u_r [1]", "u_t [1]"] if name == "dive" else ["command [1]"]
    units = {"yaw velocity": "rad/s", "heading": "rad"}
    titles = ["time [s]", *inputs]
    titles += [f"{one} [{units.get(one, 'm/s' if 'velocity' in one else 'm')}]" for one in quantities]
    numbers = np.column_stack([0.1 * np.arange(90), random.uniform(-0.5, 0.5, (90, len(titles) - 1))])
    text = "\n".join([",".join(titles), *(",".join(f"{x:.4f}" for x in row) for row in numbers.tolist())])
    beginning, (log,), _ = begin(load_tests(folder_of(tmp_path, f'base = "videoray"\n{HEAD}', {file: text})))
    log = replace(log, record=replace(log.record, wanders=wanders))
    table = table_of(beginning, [log], [])
    assert [p.of for p in table.parameters if p.kind == "sensor scale"] == [*scales]
    assert [(p.of, p.part) for p in table.parameters if p.kind == "sensor offset"] == [(file, one) for one in offsets]
    z = random.uniform(0.05, 0.3, len(table.parameters))
    filtered, names = table.of_log(z, log), [m.channel.quantity.name for m in log.measured]
    of = partial(table.get, z)
    assert filtered.offsets == tuple(of("sensor offset", file, one) for one in names)
    assert filtered.mean_drifts == tuple(of("sensor offset", file, one) for one in OVER_GROUND)
    axes = [m.sensor.axis.name if m.sensor.is_velocity else "" for m in log.measured]
    assert filtered.scales == pytest.approx([exp(of("sensor scale", axis)) for axis in axes])


def test_parameters_enter_the_model_as_their_names_say(known: Known) -> None:
    table, (heave, surge) = known
    z = np.random.default_rng(0).uniform(0.05, 0.3, len(table.parameters))
    of, c, base = partial(table.get, z), table.coefficients(z), table.base
    assert table.layout.voltage == pytest.approx(np.mean([15.19, 14.36]), abs=0.1)
    for curve in ("rear", "top"):
        scale, astern = of("thrust scale", curve), exp(of("reverse thrust", curve))
        for end, ratio, part in (("", scale, ""), ("_reverse", scale * astern, "astern")):
            names = [f"{key}_{curve}{end}" for key in ("a_t", "b_t")]
            full, more = sum(base[name] for name in names), of("linear thrust", curve, part if curve == "top" else "")
            linear = base[names[1]] + more * full
            assert [c[name] for name in names] == pytest.approx([ratio * (full - linear), ratio * linear])
        assert [c[f"{key}_{curve}"] for key in ("c_0", "T", "n_V", "d")] == [
            of("dead band", curve),
            of("lag"),
            of("voltage"),
            pytest.approx(of("advance", curve) * (c[f"a_t_{curve}"] + c[f"b_t_{curve}"])),
        ]
        lost = of("advance", curve) * exp(of("advance astern", curve))
        assert c[f"d_{curve}_reverse"] == pytest.approx(lost * (c[f"a_t_{curve}_reverse"] + c[f"b_t_{curve}_reverse"]))
    assert c["c_0_top_reverse"] == pytest.approx(of("dead band", "top") * exp(of("dead band astern", "top")))
    assert "c_0_rear_reverse" not in c, "no force of it was measured astern"
    for axis, v in ((SURGE.name, "u"), (HEAVE.name, "w")):
        for kind, name in (("quadratic drag", f"a_d_{v}"), ("linear drag", f"b_d_{v}")):
            ratio = exp(of("drag astern", axis))
            assert [c[name], c[f"{name}_reverse"]] == pytest.approx([of(kind, axis), ratio * of(kind, axis)])
        assert c[f"beta_{v}"] == pytest.approx(base[f"beta_{v}"] / of("inertia", axis))
        assert c[f"F_0_{v}"] == of("load", axis)
    of_heave, of_surge = (table.of_log(z, log) for log in (heave, surge))
    assert of_heave.offset == of("logging offset", "log_heave_0.csv") + of("dead time")
    assert of_heave.width == of("logging width", "log_heave_0.csv")
    slow = {
        8.0: [table.full["heave"] * of("inertia", "heave") * of("slow force", "heave"), of("slow velocity", "heave")],
        60.0: [of("slow gain")],
        of("correlation time", "depth"): [of("white noise", "depth") * of("coloured noise", "depth")],
    }
    for process in (*of_heave.forces, of_heave.gain, of_heave.drifts[2], *of_heave.noise):
        assert process.size == pytest.approx(slow[process.time_constant].pop(0))
    assert of_heave.white == (of("white noise", "depth"),)
    sideways = of("slow velocity", "horizontal")
    drifts = [drift.size for drift in (*of_heave.drifts[:2], *of_surge.drifts)]
    assert drifts == [0.0, 0.0, sideways, sideways, 0.0]
    for p, tested in ((of_heave, HEAVE), (of_surge, SURGE)):
        ((q, back, typical),) = p.powers
        more = [of(f"power of drag{end}", tested.name) for end in ("", " astern")]
        assert np.array([q, back - q]) == pytest.approx(more)
        quadratic, linear = (base[tested.coefficient(key)] for key in ("a_d", "b_d"))
        quarter = 0.25 * table.full[tested.name]
        assert quadratic * typical**2 + linear * typical == pytest.approx(quarter), "of full thrust"
    assert [p.coefficients["V_N"] for p in (of_heave, of_surge)] == [
        0.0,
        of("current", "log_surge_0.csv", "to the north"),
    ]


def test_a_linear_drag_of_0_has_a_prior_next_to_0(fit: Fit) -> None:
    known = replace(fit.known, coefficients={**fit.known.coefficients, "b_d_w": 0.0})
    table = table_of(known, fit.objective.logs, [])
    (drag,) = (p for p in table.parameters if (p.kind, p.of) == ("linear drag", "heave"))
    assert exp(drag.mean) == pytest.approx(1e-9)


def test_code_asks_a_kind_what_it_declares_and_not_for_its_name() -> None:
    """Then a new kind needs an entry in the table, and what it does to the model, and no branch elsewhere."""
    names = KINDS.keys() - {quantity.name for quantity in QUANTITIES.values()}
    for path in Path(identify.__file__).parent.rglob("*.py"):
        nodes = [*ast.walk(ast.parse(path.read_text("utf-8")))]
        asked = [part for node in nodes if isinstance(node, ast.Compare | ast.Call) for part in ast.walk(node)]
        literals = {str(part.value) for part in asked if isinstance(part, ast.Constant)}
        everywhere = {str(part.value) for part in nodes if isinstance(part, ast.Constant)}
        named = names & (literals | {text for text in everywhere if " " in text})
        assert not named or path.name in PHYSICS, path


def test_the_file_of_an_uncertain_geometry_moves_as_the_fit() -> None:
    """Its thrusters have other directions and places, and no coefficient of the geometry, along all six axes."""
    whole = rov_fmu.load("bluerov2_heavy")
    layout = replace(without_surface(whole).layout, mix={}, is_uncertain=True)
    layout = layout.extended(curve.coefficient("d") for curve in layout.curves)
    values = {name: whole.coefficients.get(name, 3.0) for name in layout.coefficients}
    angle = {"g_u": np.cos(0.7) * np.sqrt(2.0), "g_v": np.sin(0.7) * np.sqrt(2.0)}
    uncertain = {**angle, "g_r": 1.02, "x_T": 0.0046, "y_T": -0.012}
    table = Table(layout, values | uncertain, {}, ())
    placed = replace(layout, thrusters=table.thrusters_in_file(np.zeros(0)), is_uncertain=False)
    of_file = Vehicle(placed, {name: values[name] for name in placed.coefficients})
    assert not {*uncertain} & {*of_file.coefficients}
    of_fit, rng = Vehicle(layout, table.base), np.random.default_rng(0)
    for thruster in placed.thrusters:
        X, Y, Z = thruster.direction.value
        assert abs(Z) == pytest.approx(1.0) or np.arctan2(abs(Y), abs(X)) == pytest.approx(0.7)
    for _ in range(5):
        inputs = layout.usual_inputs | {name: rng.uniform(-1.0, 1.0) for name in layout.commands}
        state = layout.at_rest | {axis.velocity: rng.uniform(-1.0, 1.0) for axis in layout.bare_axes}
        state |= {name: rng.uniform(-20.0, 20.0) for name in layout.at_rest if name.startswith("F_")}
        one, other = (vehicle.derivatives(inputs, state) for vehicle in (of_fit, of_file))
        for axis in layout.bare_axes:
            assert other[axis.velocity] == pytest.approx(one[axis.velocity], rel=1e-9, abs=1e-9)
    certain = Table(layout, values | {"g_u": 1.0, "g_v": 1.0, "g_r": 1.0, "x_T": 0.0, "y_T": 0.0}, {}, ())
    assert certain.thrusters_in_file(np.zeros(0)) == layout.thrusters
