"""The output `outside` of an identified vehicle, beside a formula that is written here by hand."""

import math
import random
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from mpmath import mp

import rov_fmu
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.dependencies import dependencies_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import vehicle_output
from tests import fmi3
from tests.conftest import unzipped
from tests.fmi import (
    CO_SIMULATION,
    CONTINUOUS,
    ERROR,
    EVENT,
    EVERY_MODE,
    FAILED,
    INITIALIZATION,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    STEP,
    WITH_EVENTS,
    AnyInstance,
    Fmu,
)
from tests.fmu.calls.conftest import WRAPPERS

Values = Mapping[str, float]

_COMMAND = 0.7
_FLAT = {"u": (0.2, 0.5), "w": (-0.1, 0.3), "r": (-1.0, 2.0), "z": (0.0, 3.0)}
"""The ranges of a vehicle without roll and pitch; that of surge does not begin at 0, and there is one of the depth."""
_TILTED = {"u": (-0.4, 0.4), "v": (-0.2, 0.2), "p": (-0.3, 0.5), "phi": (-0.1, 0.2), "theta": (-0.3, 0.05)}
_UNITS = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "r": "rad/s", "z": "m", "phi": "rad", "theta": "rad"}


def _identified(name: str, ranges: Mapping[str, tuple[float, float]], folder: Path) -> Vehicle:
    """Return a vehicle that ships, with identified ranges, read from a file."""
    vehicle = load_vehicle(SHIPPED[name])
    lines = [f'{key} = {{ range = {[*ends]}, unit = "{_UNITS[key]}" }}' for key, ends in ranges.items()]
    text = SHIPPED[name].read_text(encoding="utf-8").replace("pictures = ", "# ").replace("data = ", "# ")
    table = "\n".join(["[validity.identified]", *lines, "", "[body]"])
    path = folder / f"{name}.toml"
    path.write_text(text.replace(f"command_max = {vehicle.command_range[1]}", f"command_max = {_COMMAND}"), "utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("[body]", table, 1), encoding="utf-8")
    return load_vehicle(path)


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    return _identified("videoray", _FLAT, tmp_path_factory.mktemp("flat"))


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    return _identified("bluerov2_heavy", _TILTED, tmp_path_factory.mktemp("tilted"))


def _expected(values: Mapping[str, Any], ranges: Mapping[str, tuple[float, float]]) -> Any:
    """Return the largest excess over a range, relative to the range from 0 on. The depth does not count.

    The attitude is given by phi and theta, or by the quaternion. The numbers may have any precision.
    """
    excess = [0.0]
    if "eta" in values:
        e, a, b, c = (values[name] for name in QUATERNION)
        phi = mp.atan2(2 * (e * a + b * c), e * e - a * a - b * b + c * c)
        theta = mp.asin(2 * (e * b - a * c) / (e * e + a * a + b * b + c * c))
        values = {**values, "phi": phi, "theta": theta}
    for name, value in values.items():
        if name.startswith("u_"):
            excess.append((min(abs(value), 1.0) - _COMMAND) / _COMMAND)
        elif name in ranges and name != "z":
            low, high = min(ranges[name][0], 0.0), max(ranges[name][1], 0.0)
            excess += [(value - high) / (high - low), (low - value) / (high - low)]
    return max(excess)


def test_it_is_the_largest_excess_relative_to_its_range(flat: Vehicle) -> None:
    drawn = random.Random(1)
    counted = 0
    for _ in range(300):
        size = drawn.choice((0.3, 1.0, 3.0))
        inputs = {name: drawn.uniform(-size, size) for name in flat.layout.commands}
        motion = {name: drawn.uniform(-size, size) for name in ("u", "w", "r", "z")}
        found = flat.calculated({**flat.layout.usual_inputs, **inputs}, {**flat.layout.at_rest, **motion})["outside"]
        assert found == pytest.approx(_expected({**inputs, **motion}, _FLAT), rel=1e-13, abs=0.0)
        counted += found == 0.0
    assert 10 < counted < 290, "some are inside"


@pytest.mark.parametrize("name", ["u_l", "u", "w", "r"])
def test_exactly_at_an_end_it_is_0_and_beyond_it_is_not(name: str, flat: Vehicle) -> None:
    ends = (-_COMMAND, _COMMAND) if name == "u_l" else (min(_FLAT[name][0], 0.0), _FLAT[name][1])

    def at(value: float) -> float:
        values = {**flat.layout.usual_inputs, **flat.layout.at_rest, name: value}
        return flat.calculated(values, values)["outside"]

    for end, away in zip(ends, (-math.inf, math.inf), strict=True):
        assert at(end) == 0.0
        assert 0.0 < at(math.nextafter(end, away)) < 1e-14 or end == 0.0
    assert at(0.0) == 0.0, "every motion begins at rest"
    assert math.isfinite(at(1e6))


@pytest.fixture(scope="module")
def folder_of(flat: Vehicle, tilted: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Path]:
    """Return the unzipped FMU of the flat or the tilted vehicle in a version of FMI, which is built once."""
    vehicles = {"flat": flat, "tilted": tilted}

    @cache
    def built(name: str, fmi: int) -> Path:
        return unzipped(vehicles[name], tmp_path_factory.mktemp(name), fmi)

    return built


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_the_fmu_calculates_it(
    fmi: int, kind: str, flat: Vehicle, tilted: Vehicle, folder_of: Callable[[str, int], Path]
) -> None:
    """In both interfaces and versions of FMI, at the start and at every step, from the other outputs."""
    for name, vehicle, ranges, axis in (("flat", flat, _FLAT, "surge"), ("tilted", tilted, _TILTED, "roll")):
        own = vehicle.layout.kinds[axis].axis
        commands = vehicle.layout.driving(own, 0.9)
        names = [*vehicle.layout.velocities, *vehicle.layout.angles]
        result = fmpy.simulate_fmu(
            str(folder_of(name, fmi)),
            fmi_type=kind,
            stop_time=2.0,
            output_interval=0.1,
            start_values={**commands, "u": 0.45},
            output=[*names, "outside"],
        )
        expected = [_expected({**commands, **{n: row[n] for n in names}}, ranges) for row in result]
        np.testing.assert_allclose(result["outside"], expected, rtol=1e-12, atol=1e-15)
        assert result["outside"][0] == pytest.approx(max((0.9 - _COMMAND) / _COMMAND, expected[0]))
        assert len({*result["outside"]}) > 3, "it changes"


# ---- The calls of FMI ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=[("flat", 2), ("flat", 3), ("tilted", 2), ("tilted", 3)], ids=str)
def fmu(request: pytest.FixtureRequest, folder_of: Callable[[str, int], Path]) -> Fmu:
    name, fmi = request.param
    return WRAPPERS[fmi](folder_of(name, fmi))


@pytest.fixture(scope="module")
def fmu3(folder_of: Callable[[str, int], Path]) -> fmi3.Fmu:
    return fmi3.Fmu(folder_of("flat", 3))


def _ranges(fmu: Fmu) -> Mapping[str, tuple[float, float]]:
    return _TILTED if "eta" in fmu.states else _FLAT


def _points(fmu: Fmu, number: int, seed: int) -> list[dict[str, float]]:
    """Return random commands, velocities and attitudes; in turns, each kind is what may be outside."""
    drawn = random.Random(seed)
    found = []
    for n in range(number):
        command, velocity = ((0.5, 2.0), (0.95, 0.02), (0.5, 0.02))[n % 3]
        point = {name: drawn.uniform(-command, command) for name in fmu.commands}
        point |= {name: drawn.uniform(-velocity, velocity) for name in "uvwpqr" if name in fmu.variables}
        if "phi_0" in fmu.parameters:
            angle = 0.02 if n % 3 == 1 else 1.0
            point |= {"phi_0": drawn.uniform(-angle, angle), "theta_0": drawn.uniform(-angle, angle), "psi_0": 2.0}
        found.append(point)
    return found


def _read(rov: AnyInstance) -> dict[str, float]:
    """Return the commands and the states of an instance."""
    names = [*rov.fmu.commands, *rov.fmu.states]
    return dict(zip(names, rov.get(names), strict=True))


def _at(fmu: Fmu, point: Values, kind: int, mode: str) -> AnyInstance:
    rov = fmu.instance(kind)
    rov.set(point)
    rov.reach(mode)
    return rov


def _slope(values: Values, known: str, ranges: Mapping[str, tuple[float, float]]) -> float:
    """Return the slope of the formula by a command or a state, computed in 50 digits."""
    with mp.workdps(50):
        exact = {name: mp.mpf(value) for name, value in values.items()}
        h = mp.mpf(10) ** -20
        low, high = (_expected({**exact, known: exact[known] + side * h}, ranges) for side in (-1, 1))
        return float((high - low) / (2 * h))


@pytest.mark.parametrize(("kind", "mode"), [c for c in EVERY_MODE if c[1] not in (INSTANTIATED, FAILED)], ids=str)
def test_its_directional_derivatives_are_the_slopes_of_the_formula(fmu: Fmu, kind: int, mode: str) -> None:
    """By each input and each state; it does not depend on the depth, on loads or on coefficients."""
    moved = set()
    for point in _points(fmu, 12, seed=2):
        with _at(fmu, point, kind, mode) as rov:
            values = _read(rov)
            for known in (*fmu.inputs, *fmu.states):
                expected = _slope({**values, known: values.get(known, 0.0)}, known, _ranges(fmu))
                (found,) = rov.derivatives(["outside"], known)
                assert found == pytest.approx(expected, rel=1e-11, abs=1e-14), (known, point)
                moved |= {known} if found else set()
    assert {*fmu.commands} & moved
    assert {*_ranges(fmu)} & moved
    assert ("eta" not in fmu.states) or {*QUATERNION} & moved


@pytest.mark.parametrize("fmu", [("tilted", 2), ("tilted", 3)], indirect=True, ids=str)
def test_at_the_start_it_follows_from_the_angles_that_are_parameters(fmu: Fmu) -> None:
    for point in _points(fmu, 6, seed=3):
        with _at(fmu, point, CO_SIMULATION, INITIALIZATION) as rov:
            angles = {"phi": point["phi_0"], "theta": point["theta_0"]}
            others = {name: value for name, value in point.items() if not name.endswith("_0")}
            for name in angles:
                slope = _slope({**others, **angles}, name, _ranges(fmu))
                assert rov.derivatives(["outside"], f"{name}_0") == pytest.approx([slope], rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("name", ["u_l", "u", "r"])
def test_exactly_at_an_end_its_derivative_is_that_of_the_inside(fmu3: fmi3.Fmu, name: str) -> None:
    for end in (-_COMMAND, _COMMAND) if name == "u_l" else (min(_FLAT[name][0], 0.0), _FLAT[name][1]):
        with _at(fmu3, {name: end}, CO_SIMULATION, INITIALIZATION) as rov:
            assert rov.derivatives(["outside"], name) == [0.0]
            rov.set({name: 1.01 * end or -0.01})
            assert rov.derivatives(["outside"], name) != [0.0]


@pytest.mark.parametrize(("kind", "mode"), [(MODEL_EXCHANGE, CONTINUOUS), (CO_SIMULATION, STEP)])
def test_its_adjoint_derivatives_are_the_same_row(fmu3: fmi3.Fmu, kind: int, mode: str) -> None:
    knowns = [*fmu3.inputs, *(fmu3.states if kind == MODEL_EXCHANGE else ())]
    for point in _points(fmu3, 6, seed=4):
        with fmu3.instance(kind) as rov:
            rov.set(point)
            rov.reach(mode)
            values = _read(rov)
            row = [_slope({**values, known: values.get(known, 0.0)}, known, _FLAT) for known in knowns]
            assert rov.adjoint(["outside"], knowns, [1.0]) == pytest.approx(row, rel=1e-12, abs=1e-14)


def test_its_derivative_by_time_is_the_chain_rule(fmu: Fmu) -> None:
    """As the derivative of an output in Co-Simulation, with the commands held."""
    found = []
    for point in _points(fmu, 12, seed=5):
        with _at(fmu, point, CO_SIMULATION, STEP) as rov:
            values = _read(rov)
            slopes = {name: _slope(values, name, _ranges(fmu)) for name in fmu.states}
            rates = dict(zip(fmu.states, rov.get(fmu.derivatives), strict=True))
            expected = sum(slopes[name] * rates[name] for name in fmu.states)
            found += rov.rates(["outside"])
            assert found[-1] == pytest.approx(expected, rel=1e-11, abs=1e-12)
    assert any(found)


def test_what_is_set_counts_at_once(fmu: Fmu) -> None:
    """In every mode in which a command or a state can be set; `outside` itself cannot be set."""
    for kind, mode in [c for c in EVERY_MODE if c[1] in (INITIALIZATION, EVENT, CONTINUOUS, STEP)]:
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            assert rov.get(["outside"]) == [0.0]
            for point in _points(fmu, 6, seed=6):
                values = {name: value for name, value in point.items() if name in fmu.settable(mode)}
                rov.set(values)
                assert rov.get(["outside"]) == [pytest.approx(float(_expected(_read(rov), _ranges(fmu))), rel=1e-12)]
            before = rov.save()
            rov.set({"outside": 0.0}, ERROR)
            assert "outside" in rov.log[-1].text
            assert rov.save() == before


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
def test_a_restored_state_has_it_again(fmu: Fmu, kind: int) -> None:
    mode, moved = STEP if kind == CO_SIMULATION else CONTINUOUS, 0
    for point in _points(fmu, 6, seed=7):
        with _at(fmu, point, kind, mode) as rov, fmu.instance(kind, name="other") as other:
            names = ["outside", *fmu.states]
            saved, before = rov.save(), rov.get(names)
            moved += before[0] > 0.0
            first = rov.trajectory(range(5), 0.05) if kind == CO_SIMULATION else b""
            rov.set(dict.fromkeys(fmu.commands, 0.9))
            assert kind == CO_SIMULATION or rov.set({"u": 3.0}) == OK
            assert rov.get(names) != before
            for one in (rov, other):
                one.load(saved)
                assert one.get(names) == before
                assert kind == MODEL_EXCHANGE or one.trajectory(range(5), 0.05) == first
    assert moved


@pytest.mark.parametrize("kind", [MODEL_EXCHANGE, WITH_EVENTS])
def test_in_event_mode_it_is_that_of_the_values_set(fmu3: fmi3.Fmu, kind: int) -> None:
    """And in the mode after it: leaving Event Mode changes neither it nor its slopes."""
    with fmu3.instance(kind) as rov:
        rov.reach(EVENT)
        for point in _points(fmu3, 6, seed=8):
            rov.set(point)
            expected = float(_expected(_read(rov), _FLAT))
            assert rov.get(["outside"]) == [pytest.approx(expected, rel=1e-12)]
            rov.update()
            rov.expect("EnterContinuousTimeMode" if kind == MODEL_EXCHANGE else "EnterStepMode")
            values = _read(rov)
            assert rov.get(["outside"]) == [pytest.approx(expected, rel=1e-12)]
            for known in (*fmu3.commands, *"uwr"):
                assert rov.derivatives(["outside"], known) == [pytest.approx(_slope(values, known, _FLAT), rel=1e-11)]
            if kind != MODEL_EXCHANGE:
                rov.step(rov.time(), 0.1)
                assert rov.get(["outside"]) == [pytest.approx(float(_expected(_read(rov), _FLAT)), rel=1e-12)]
            rov.expect("EnterEventMode")


def test_python_simulates_it(tilted: Vehicle) -> None:
    assert tilted.path
    run = rov_fmu.load(tilted.path).simulate(0.3, tilted.layout.driving(tilted.layout.kinds["roll"].axis, 0.9))
    for n in range(len(run.time)):
        values = {name: float(run[name][n]) for name in (*tilted.layout.velocities, "phi", "theta")}
        commands = {"u_any": 0.9}
        assert float(run["outside"][n]) == pytest.approx(_expected({**commands, **values}, _TILTED), rel=1e-12)


def test_its_dependencies_are_what_it_is_calculated_from(flat: Vehicle) -> None:
    known = dependencies_of(flat.layout)["outside"]
    assert known == dict.fromkeys(("u_l", "u_r", "u_t", "u", "w", "r"), "dependent")


def test_the_ranges_are_written_and_read(flat: Vehicle, tmp_path: Path) -> None:
    output = vehicle_output(flat, tmp_path / "again.toml")
    output.path.write_bytes(output.content)
    assert load_vehicle(output.path).layout.identified == flat.layout.identified


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('u = { range = [0.0, 0.0], unit = "m/s" }', "must be [low, high], and one of them at least 1e-06 away from 0"),
        ('u = { range = [0.5, 0.2], unit = "m/s" }', "must be [low, high], and one of them at least 1e-06 away from 0"),
        ('u = { range = [nan, 0.2], unit = "m/s" }', "must be a finite number"),
        ('u = { range = [0.0, 0.2], unit = "rad/s" }', "must have the range of u in m/s, and not in rad/s"),
        ('x = { range = [0.0, 0.2], unit = "m" }', "must have ranges of u, v, w, p, q, r, phi, theta, z, and not of x"),
    ],
)
def test_a_range_that_makes_no_sense_is_one_line(line: str, reason: str, flat: Vehicle, tmp_path: Path) -> None:
    assert flat.path
    path = tmp_path / "wrong.toml"
    text = flat.path.read_text(encoding="utf-8")
    path.write_text(text.replace("[validity.identified]", f"[validity.identified]\n{line} #", 1), encoding="utf-8")
    kept = [row for row in path.read_text(encoding="utf-8").splitlines() if not row.startswith("u = { range = [0.2")]
    path.write_text("\n".join(kept), encoding="utf-8")
    with pytest.raises(VehicleFileError) as error:
        load_vehicle(path)
    assert str(error.value).startswith(f"{path}: validity.identified")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_the_vehicles_that_ship_keep_their_variables() -> None:
    assert not [name for name in SHIPPED if load_vehicle(SHIPPED[name]).layout.outside]
