"""The output `outside` of an identified vehicle, beside a formula that is written here by hand."""

import random
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from mpmath import mp

import rov_fmu
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from tests import fmi3
from tests.conftest import Made, unzipped
from tests.fmi import (
    CO_SIMULATION,
    CONTINUOUS,
    ERROR,
    EVENT,
    INITIALIZATION,
    MODEL_EXCHANGE,
    STEP,
    TERMINATED,
    AnyInstance,
    Fmu,
)
from tests.fmu.calls.conftest import WRAPPERS, modes_of

Values = Mapping[str, float]
Ranges = Mapping[str, tuple[float, float]]

_COMMAND = 0.7
_FLAT = {"u": (0.2, 0.5), "w": (-0.1, 0.3), "r": (-1.0, 2.0), "z": (0.0, 3.0)}
"""The ranges of a vehicle without roll and pitch; that of surge does not begin at 0, and there is one of the depth."""
_TILTED = {"u": (-0.4, 0.4), "v": (-0.2, 0.2), "p": (-0.3, 0.5), "phi": (-0.1, 0.2), "theta": (-0.3, 0.05)}
_UNITS = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "r": "rad/s", "z": "m", "phi": "rad", "theta": "rad"}


def _identified(name: str, ranges: Ranges, folder: Path) -> Vehicle:
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
def vehicles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Vehicle, Ranges]]:
    """Return a vehicle without roll and pitch and one with both, each with its ranges."""
    kinds = {"flat": ("videoray", _FLAT), "tilted": ("bluerov2_heavy", _TILTED)}
    return {
        kind: (_identified(name, ranges, tmp_path_factory.mktemp(kind)), ranges)
        for kind, (name, ranges) in kinds.items()
    }


@pytest.fixture
def flat(vehicles: dict[str, tuple[Vehicle, Ranges]]) -> Vehicle:
    return vehicles["flat"][0]


def _expected(values: Mapping[str, Any], ranges: Ranges) -> Any:
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


@pytest.fixture(scope="module", params=[("flat", 2), ("tilted", 3)], ids=str)
def built(
    request: pytest.FixtureRequest, vehicles: dict[str, tuple[Vehicle, Ranges]], made_once: Made
) -> tuple[Fmu, Vehicle, Ranges]:
    """Return the FMU of either vehicle in either version of FMI, with the vehicle and its ranges."""
    name, fmi = request.param
    vehicle, ranges = vehicles[name]
    return WRAPPERS[fmi](made_once(f"outside {name}", partial(unzipped, vehicle, fmi=fmi))), vehicle, ranges


@pytest.fixture
def fmu(built: tuple[Fmu, Vehicle, Ranges]) -> Fmu:
    return built[0]


@pytest.fixture
def ranges(built: tuple[Fmu, Vehicle, Ranges]) -> Ranges:
    return built[2]


@pytest.mark.long
def test_a_simulation_has_it_at_every_step(built: tuple[Fmu, Vehicle, Ranges]) -> None:
    """In both interfaces and versions of FMI and in Python, from the other outputs."""
    fmu, vehicle, ranges = built
    axis = "roll" if vehicle.layout.has_attitude else "surge"
    commands = vehicle.layout.driving(vehicle.layout.kinds[axis].axis, 0.9)
    names = [*vehicle.layout.velocities, *vehicle.layout.angles]
    how: dict[str, Any] = {"start_values": {**commands, "u": 0.45}, "output": [*names, "outside"]}
    assert vehicle.path
    stop = 0.3 if axis == "roll" else 2.0  # later it turns over, which is a warning in Python
    for result in (
        rov_fmu.load(vehicle.path).simulate(stop, commands, start={"u": 0.45}),
        *(
            fmpy.simulate_fmu(str(fmu.folder), fmi_type=kind, stop_time=2.0, output_interval=0.1, **how)
            for kind in ("CoSimulation", "ModelExchange")
        ),
    ):
        rows = zip(*(result[name] for name in names), strict=True)
        expected = [float(_expected({**commands, **dict(zip(names, row, strict=True))}, ranges)) for row in rows]
        np.testing.assert_allclose(result["outside"], expected, rtol=1e-12, atol=1e-15)
        assert result["outside"][0] == pytest.approx(max((0.9 - _COMMAND) / _COMMAND, expected[0]))
        assert len({*result["outside"]}) > 3, "it changes"


# ---- The calls of FMI ------------------------------------------------------------------------------------------------


def _points(fmu: Fmu, number: int, seed: int) -> list[dict[str, float]]:
    """Return random commands, velocities and attitudes; in turns, each kind is what may be outside."""
    drawn = random.Random(seed)
    found = []
    for n in range(number):
        command, velocity, angle = ((0.5, 2.0, 1.0), (0.95, 0.02, 0.02), (0.5, 0.02, 1.0))[n % 3]
        point = {name: drawn.uniform(-command, command) for name in fmu.commands}
        point |= {name: drawn.uniform(-velocity, velocity) for name in "uvwpqr" if name in fmu.variables}
        point |= {name: drawn.uniform(-angle, angle) for name in ("phi_0", "theta_0") if name in fmu.variables}
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


def _slope(values: Values, known: str, ranges: Ranges) -> float:
    """Return the slope of the formula by a command or a state, computed in 50 digits."""
    with mp.workdps(50):
        exact = {name: mp.mpf(value) for name, value in {known: 0.0, **values}.items()}
        h = mp.mpf(10) ** -20
        low, high = (_expected({**exact, known: exact[known] + side * h}, ranges) for side in (-1, 1))
        return float((high - low) / (2 * h))


def _modes(fmu: Fmu, *modes: str) -> list[tuple[int, str]]:
    """Return these modes of all kinds of instances of an FMU."""
    return [case for case in modes_of(fmu.VERSION) if case[1] in modes]


def test_its_derivatives_are_the_slopes_of_the_formula_in_every_mode(fmu: Fmu, ranges: Ranges) -> None:
    """By each input and each state; it does not depend on the depth, on loads or on coefficients."""
    knowns = [*fmu.inputs, *fmu.states]
    moved = set[str]()
    for point in _points(fmu, 12, seed=2):
        with _at(fmu, point, CO_SIMULATION, INITIALIZATION) as rov:
            values = _read(rov)
        slopes = [_slope(values, known, ranges) for known in knowns]
        moved |= {known for known, slope in zip(knowns, slopes, strict=True) if slope}
        for kind, mode in _modes(fmu, INITIALIZATION, EVENT, CONTINUOUS, STEP, TERMINATED):
            with _at(fmu, point, kind, mode) as rov:
                expected = pytest.approx(slopes, rel=1e-11, abs=1e-14)
                assert [rov.derivatives(["outside"], known)[0] for known in knowns] == expected, (kind, mode, point)
                if isinstance(rov, fmi3.Instance):
                    assert rov.adjoint(["outside"], knowns, [1.0]) == expected
    assert {*fmu.commands} & moved
    assert {*ranges} & moved
    assert ("eta" not in fmu.states) or {*QUATERNION} & moved


def test_at_the_start_it_follows_from_the_angles_that_are_parameters(fmu: Fmu, ranges: Ranges) -> None:
    for point in _points(fmu, 6, seed=3) if "phi_0" in fmu.variables else ():
        with _at(fmu, point, CO_SIMULATION, INITIALIZATION) as rov:
            values = {name.removesuffix("_0"): value for name, value in point.items()}
            for name in ("phi", "theta"):
                slope = _slope(values, name, ranges)
                assert rov.derivatives(["outside"], f"{name}_0") == pytest.approx([slope], rel=1e-11, abs=1e-13)


def test_exactly_at_an_end_it_is_0_and_its_derivative_is_that_of_the_inside(fmu: Fmu, ranges: Ranges) -> None:
    for name, (low, high) in {fmu.commands[0]: (-_COMMAND, _COMMAND), **ranges}.items():
        for end in (min(low, 0.0), max(high, 0.0)) if name in (fmu.commands[0], *"uvwpr") else ():
            with _at(fmu, {name: end}, CO_SIMULATION, INITIALIZATION) as rov:
                assert rov.get(["outside"]) == rov.derivatives(["outside"], name) == [0.0]
                rov.set({name: 1.01 * end or -0.01})
                assert rov.derivatives(["outside"], name) != [0.0]


def test_what_is_set_or_restored_counts_at_once(fmu: Fmu, ranges: Ranges) -> None:
    """In every mode in which a command or a state can be set; `outside` itself cannot be set."""
    for kind, mode in _modes(fmu, INITIALIZATION, EVENT, CONTINUOUS, STEP):
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            assert rov.get(["outside"]) == [0.0]
            saved = {0.0: rov.save()}
            for point in _points(fmu, 6, seed=6):
                rov.set({name: value for name, value in point.items() if name in fmu.settable(mode)})
                expected = pytest.approx(float(_expected(_read(rov), ranges)), rel=1e-12)
                assert rov.get(["outside"]) == [expected]
                if mode == EVENT:
                    rov.update()
                    rov.expect("EnterContinuousTimeMode" if kind == MODEL_EXCHANGE else "EnterStepMode")
                    assert rov.get(["outside"]) == [expected]
                    rov.expect("EnterEventMode")
                saved[rov.get(["outside"])[0]] = rov.save()
            assert len(saved) > 1
            for outside, state in saved.items():
                rov.load(state)
                assert rov.get(["outside"]) == [outside]
            before = rov.save()
            rov.set({"outside": 0.0}, ERROR)
            assert "outside" in rov.log[-1].text
            assert rov.save() == before


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('u = { range = [0.0, 0.0], unit = "m/s" }', "must be [low, high], and one of them at least 1e-06 away from 0"),
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
