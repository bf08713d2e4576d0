"""Any vehicle is written and read back to the last bit; any damaged file is a vehicle that works, or clear lines."""

import random
from collections.abc import Callable
from dataclasses import replace
from math import isfinite, sqrt
from pathlib import Path

import pytest
from fmpy.model_description import ModelDescription, read_model_description
from hypothesis import strategies as st

from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.description import Provenance
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import vehicle_text, write_vehicle
from tests.commands import REFIT
from tests.damage import changed_bytes, changed_lines, changed_numbers, changed_toml, fuzz
from tests.often import often
from tests.vehicle.test_vehicle import refusal
from tests.vehicles import EVERYTHING, SIX_AXES, bases

TEXT = VIDEORAY.read_text(encoding="utf-8")
SOURCES = [path.read_bytes() for path in (VIDEORAY, REFIT, EVERYTHING, EVERYTHING)]
TEXTS = ('ROV "Döv" \\ 1', "潜水艇 [1]", "a # b = 'c'", "x" * 90)
HASH = "0123456789abcdef" * 4
_BUILT = 10
"""Every tenth file that can be read is made into an FMU."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the path of the file to write; the folders of the VideoRay are beside it."""
    for folder in ("tables", "pictures"):
        (tmp_path / folder).symlink_to(VIDEORAY.parent / folder, target_is_directory=True)
    return tmp_path / "rov.toml"


def check_refusal(message: str, path: Path) -> None:
    """Check that the lines are printable, begin with the file and have a limited length."""
    for text in message.splitlines():
        assert text.startswith(f"{path}: ")
        assert text.isprintable()
        assert len(text) - len(str(path)) < 300


def check_usable(vehicle: Vehicle) -> None:
    """Check that all numbers are within their bounds, and that a step gives finite numbers."""
    layout = vehicle.layout
    assert set(vehicle.coefficients) == set(layout.coefficients) == set(vehicle.sources)
    for name, declaration in layout.coefficients.items():
        assert declaration.minimum <= vehicle[name] <= declaration.maximum
    low, high = vehicle.command_range
    assert 0.0 <= low < high <= 1.0
    assert all(isfinite(end) for interval in vehicle.intervals.values() for end in interval)
    inputs = dict.fromkeys(layout.inputs, 0.0) | dict(zip(layout.commands, (0.3, 0.2, -0.1, 1.0), strict=False))
    h = 0.1
    if layout.coupled:  # coupled axes settle together; until then the fastest decay limits each piece
        axes = vehicle.motions(inputs)
        drags = [(axis, drag) for axis in axes for drag in ((axis.A, axis.B), axis.reverse or (0.0, 0.0))]
        h = min(h, 1000.0 / max(1.0, *(B + 2.0 * sqrt(A * abs(axis.C)) for axis, (A, B) in drags)))
    after = vehicle.step(inputs, dict.fromkeys(layout.state, 0.0), h)
    assert all(isfinite(value) for value in after.values())


def description(vehicle: Vehicle, folder: Path) -> ModelDescription:
    """Return what FMPy reads and validates from an FMU without binaries."""
    fmu = folder / "only.fmu"
    fmu.write_bytes(archive(native_content(vehicle).files))
    return read_model_description(str(fmu), validate=True)


@often("examples", 15, 100, 1000)
def test_any_file_is_a_usable_vehicle_or_one_clear_line(examples: int, path: Path) -> None:
    usable = 0

    def check(data: st.DataObject) -> None:
        nonlocal usable
        change = data.draw(
            st.sampled_from([changed_toml, changed_numbers, changed_numbers, changed_lines, changed_bytes])
        )
        path.write_bytes(change(data.draw(st.sampled_from(SOURCES)), data))
        try:
            vehicle = load_vehicle(path)
        except VehicleFileError as error:
            check_refusal(str(error), path)
            return
        check_usable(vehicle)
        usable += 1
        if usable % _BUILT == 0:
            assert description(vehicle, path.parent).modelName == vehicle.identifier

    fuzz(check, examples)
    assert usable > examples / 20, "the changes must leave some files as good as they were"


def drawn(path: Path, rng: random.Random) -> Vehicle:
    """Return the vehicle of a file with other numbers, texts, intervals and provenance."""
    rov = load_vehicle(path)
    limits = {name: (one.minimum, one.maximum) for name, one in rov.layout.coefficients.items()}
    scaled = {name: value * rng.uniform(0.999, 1.001) for name, value in rov.coefficients.items()}
    values = {name: min(max(value, limits[name][0]), limits[name][1]) for name, value in scaled.items()}
    known = [name for name, value in values.items() if value > 0.0 and (rov.estimates or rng.random() < 0.3)]
    return replace(
        rov,
        coefficients=values,
        basis=bases(
            dict.fromkeys(values, rng.choice(TEXTS)),
            {**rov.intervals, **{n: (values[n] * (1.0 - 1e-9) / 3.0, 3.0 * values[n]) for n in known}},
            {n: row.model_copy(update={"error": row.error * 1.1}) for n, row in rov.estimates.items()},
        ),
        name=rng.choice(TEXTS),
        data=None,
        pictures=None,
        alternatives={},
        provenance=Provenance(
            tool="tool", method="heave: a\nyaw: b", inputs={"ä.csv": HASH}, warnings=("a warning",), facts=("b", "c")
        ),
    )


@pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # of a lag with a wide interval
@often("times", 1, 20, 200)
def test_every_vehicle_is_read_back_to_the_last_bit(times: int, tmp_path: Path) -> None:
    """From file to vehicle to file to vehicle."""
    rng, path = random.Random(times), tmp_path / "made.toml"
    for source in (EVERYTHING, SIX_AXES, *SHIPPED.values()) * times:
        made = drawn(source, rng)
        write_vehicle(made, path, force=True)
        again = load_vehicle(path)
        assert again == made
        assert (again.coefficients, again.sources) == (made.coefficients, made.sources)
        text = path.read_text(encoding="utf-8")
        assert vehicle_text(replace(again, measured_from=made.measured_from), tmp_path) == text
    assert [*tmp_path.iterdir()] == [path]


def _changed(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new)


# Mistakes that fuzzing rarely finds: how the text is changed, and what the line must contain.
RARE: dict[str, tuple[Callable[[str], str], tuple[str, ...]]] = {
    "a decimal comma": (_changed("value = 6.57", "value = 6,57"), ("not TOML", "(a number needs a decimal point)")),
    "no TOML": (_changed("[body]", "[body"), ("not TOML", "line ", ": [body")),
    "an integer larger than a double": (_changed("2.711", "1" + 400 * "0"), ("curves.rear.b_t", "at most 308 dig")),
    "a number of 5000 hexadecimal digits": (
        _changed("value = 0.22", "value = 0x" + "f" * 5000),
        ("arm.R.value", "0xfff"),
    ),
    "a key of 3000 parts": (_changed('name = "', "name" + ".a" * 3000 + ' = "'), ("name.a", "most 20")),
    "tables in tables": (lambda text: text + "deep = " + "{a=" * 50_000, ("not TOML",)),
    "a control character": (
        _changed('"VideoRay Pro 4"', r'"Video\u001b[31mRay"'),
        ("vehicle.name", r"\x1b", "control character"),
    ),
}


@pytest.mark.parametrize("case", RARE)
def test_a_rare_mistake_is_one_clear_line(case: str, path: Path) -> None:
    change, named = RARE[case]
    path.write_text(change(TEXT), encoding="utf-8")
    message = refusal(path)
    check_refusal(message, path)
    for word in named:
        assert word in message
