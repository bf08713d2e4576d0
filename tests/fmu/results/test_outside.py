"""The output `outside` of an identified vehicle, beside a formula that is written here by hand."""

import random
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from mpmath import mp

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.parts import EVERY_COMMAND
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from tests import fmi2, fmi3
from tests.conftest import Made, unzipped
from tests.fmi import CONTINUOUS, ERROR, EVENT, INITIALIZATION, MODEL_EXCHANGE, STEP, AnyInstance, Fmu
from tests.fmu.calls.conftest import modes_of
from tests.vehicles import OUTSIDE

Ranges = Mapping[str, tuple[float, float]]

_COMMAND = next(high for name, _, high in OUTSIDE.layout.identified if name == EVERY_COMMAND)
_FLAT = {"u": (0.2, 0.5), "w": (-0.1, 0.3), "r": (-1.0, 2.0), "z": (0.0, 3.0)}
"""The ranges of a vehicle without roll and pitch; that of surge does not begin at 0, and there is one of the depth."""
TILTED = {name: (low, high) for name, low, high in OUTSIDE.layout.identified if name != EVERY_COMMAND}
"""The ranges of a vehicle with six axes. tests/fmu/calls/test_derivatives.py tests its derivatives."""


def _identified(lines: Iterable[str], folder: Path) -> Vehicle:
    """Return the VideoRay with the lines of identified ranges, read from a file."""
    text = SHIPPED["videoray"].read_text(encoding="utf-8").replace("pictures = ", "# ").replace("data = ", "# ")
    path = folder / "videoray.toml"
    path.write_text(text.replace("[body]", "\n".join(["[validity.identified]", *lines, "", "[body]"]), 1), "utf-8")
    return load_vehicle(path)


def excess(values: Mapping[str, Any], ranges: Ranges) -> Any:
    """Return the largest excess over a range, relative to the range from 0 on. The depth does not count.

    The attitude is given by phi and theta, or by the quaternion. The numbers may have any precision.
    """
    found = [0.0]
    if "eta" in values:
        e, a, b, c = (values[name] for name in QUATERNION)
        phi = mp.atan2(2 * (e * a + b * c), e * e - a * a - b * b + c * c)
        theta = mp.asin(2 * (e * b - a * c) / (e * e + a * a + b * b + c * c))
        values = {**values, "phi": phi, "theta": theta}
    for name, value in values.items():
        if name.startswith("u_"):
            found.append((min(abs(value), 1.0) - _COMMAND) / _COMMAND)
        elif name in ranges and name != "z":
            low, high = min(ranges[name][0], 0.0), max(ranges[name][1], 0.0)
            found += [(value - high) / (high - low), (low - value) / (high - low)]
    return max(found)


@pytest.fixture(scope="module", params=[pytest.param("flat", marks=pytest.mark.long), "tilted"])
def built(
    request: pytest.FixtureRequest, made_once: Made, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Fmu, Vehicle, Ranges]:
    """Return an FMU of either version of FMI, with its vehicle and its ranges."""
    if request.param == "tilted":
        return fmi3.Fmu(request.getfixturevalue("outside3_dir")), OUTSIDE, TILTED
    units = {"u": "m/s", "w": "m/s", "r": "rad/s", "z": "m"}
    lines = (f'{name} = {{ range = {[*ends]}, unit = "{units[name]}" }}' for name, ends in _FLAT.items())
    vehicle = _identified(lines, tmp_path_factory.mktemp("flat"))
    return fmi2.Fmu(made_once("outside flat", partial(unzipped, vehicle))), vehicle, _FLAT


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


def test_what_is_set_or_restored_counts_at_once_and_is_that_of_python(built: tuple[Fmu, Vehicle, Ranges]) -> None:
    """In every mode in which a command or a state can be set; `outside` itself cannot be set."""
    fmu, vehicle, ranges = built
    cases = [case for case in modes_of(fmu.VERSION) if case[1] in (INITIALIZATION, EVENT, CONTINUOUS, STEP)]
    for kind, mode in cases:
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            assert rov.get(["outside"]) == [0.0]
            saved = {0.0: rov.save()}
            for point in _points(fmu, 6, seed=6):
                rov.set({name: value for name, value in point.items() if name in fmu.settable(mode)})
                values = _read(rov)
                expected = pytest.approx(float(excess(values, ranges)), rel=1e-12)
                assert rov.get(["outside"]) == [expected]
                assert vehicle.calculated(vehicle.layout.usual_inputs | values, values)["outside"] == expected
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
def test_a_range_that_makes_no_sense_is_one_line(line: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(VehicleFileError) as error:
        _identified([line], tmp_path)
    assert str(error.value).startswith(f"{tmp_path / 'videoray.toml'}: validity.identified")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)
