"""An FMU whose commands are pulse widths behaves as one with fractions at the converted inputs."""

import random
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.fmu.osp import osp_model_description
from rov_fmu.fmu.terminals import terminals
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.conftest import Made, unzipped
from tests.equation.test_thrust_effects import immediate
from tests.fmi import CONTINUOUS, MODEL_EXCHANGE, WARNING, AnyInstance, Fmu, Message
from tests.fmu.calls.conftest import WRAPPERS
from tests.vehicles import THRUST_EFFECTS, pulsed

PULSE = (1100.0, 1480.0, 1900.0)
DELAYED = load_vehicle(THRUST_EFFECTS)
FRACTIONS = replace(immediate(DELAYED), identifier="fractions")
PULSES = replace(pulsed(FRACTIONS, PULSE), identifier="pulses")


def _with_another_range(rov: Vehicle) -> Vehicle:
    """Return a vehicle whose curve bow has tables at 14 and 20 V; those of main are at 12 and 16 V."""
    main = rov.layout.curves_by_name["main"]
    tables = tuple(
        replace(table, name=f"thrust_bow_{n}", voltage=voltage)
        for n, (table, voltage) in enumerate(zip(main.tables, (14.0, 20.0), strict=True))
    )
    curves = (replace(curve, tables=tables) if curve.name == "bow" else curve for curve in rov.layout.curves)
    return replace(rov, layout=replace(rov.layout, curves=tuple(curves)))


RANGES = replace(_with_another_range(PULSES), identifier="ranges")
COMMANDS = [*FRACTIONS.layout.commands]
STATES = [*FRACTIONS.layout.state]

Pair = tuple[Fmu, Fmu]
pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=WRAPPERS, ids="FMI {}.0".format)
def fmus(request: pytest.FixtureRequest, made_once: Made) -> Pair:
    """Return the FMU with pulse widths of a version of FMI, and one of FMI 2.0 with fractions."""

    def fmu(vehicle: Vehicle, version: int) -> Fmu:
        name = f"{vehicle.identifier}{version}"
        return WRAPPERS[version](made_once(name, lambda folder: unzipped(vehicle, folder, fmi=version)))

    return fmu(PULSES, request.param), fmu(FRACTIONS, 2)


def fractions_of(pulses: dict[str, float]) -> dict[str, float]:
    """Return the commands that stand for pulse widths. A pulse of 0 is no signal."""
    low, neutral, high = PULSE
    pulses = {name: x or neutral for name, x in pulses.items()}
    return {name: (x - neutral) / (high - neutral if x > neutral else neutral - low) for name, x in pulses.items()}


def commands_of(rng: random.Random) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """Yield pulse widths, some of them beyond full thrust, and the fractions that they stand for."""
    while True:
        pulses = {name: rng.choice((0.0, PULSE[1], *[rng.uniform(1000.0, 2000.0)] * 6)) for name in COMMANDS}
        yield pulses, fractions_of(pulses)


def test_the_description_declares_the_pulse_widths(fmus: Pair) -> None:
    fmu, _ = fmus
    (unit,) = (unit for unit in fmu.description.unitDefinitions if unit.name == "us")
    assert (unit.baseUnit.s, unit.baseUnit.factor) == (1, 1e-6)
    for name in COMMANDS:
        variable = fmu.variables[name]
        declared = variable if fmu.VERSION == 2 else variable.declaredType
        assert (declared.unit, float(variable.start)) == ("us", PULSE[1])
        assert fmu.bounds(name) == (PULSE[0], PULSE[2])
        assert "pulse width, 1480 is neutral, saturates at 1100 and 1900" in variable.description
    assert b'unit="us"' in osp_model_description(PULSES.layout)
    assert terminals(PULSES.layout)[0].description == "Commands to the thrusters and fins, pulse widths"


def test_steps_are_those_of_the_fractions_bit_for_bit(fmus: Pair) -> None:
    commands = commands_of(random.Random(1))
    with fmus[0].instance() as rov, fmus[1].instance() as other:
        rov.start()
        other.start()
        for n in range(40):
            pulses, fractions = next(commands)
            assert rov.set(pulses) == other.set(fractions)
            assert rov.step(0.13 * n, 0.13) == other.step(0.13 * n, 0.13)
            assert rov.get(rov.fmu.outputs) == other.get(other.fmu.outputs)
        assert max(map(abs, rov.get(STATES))) > 0.1


def test_derivatives_in_model_exchange_are_those_of_the_fractions(fmus: Pair) -> None:
    """The values are equal bit for bit, and the directional derivatives have the scale of a pulse width."""
    rng = random.Random(2)
    unknowns = [f"der({name})" for name in STATES] + [*FRACTIONS.layout.calculated]
    low, neutral, high = PULSE
    steep: set[str] = set()
    with fmus[0].instance(MODEL_EXCHANGE) as rov, fmus[1].instance(MODEL_EXCHANGE) as other:
        for one in (rov, other):
            one.reach(CONTINUOUS)
        for _ in range(10):
            pulses = {name: rng.uniform(low + 1.0, high - 1.0) for name in COMMANDS}
            state = {name: rng.uniform(-2.0, 2.0) for name in STATES}
            assert rov.set(pulses | state) == other.set(fractions_of(pulses) | state)
            assert rov.get(unknowns) == other.get(unknowns)
            for name, pulse in pulses.items():
                span = high - neutral if pulse > neutral else neutral - low
                expected = [slope / span for slope in other.derivatives(unknowns, name)]
                steep.update(name for slope in expected if slope)
                assert rov.derivatives(unknowns, name) == pytest.approx(expected, rel=1e-15, abs=0.0)
        assert steep == {*COMMANDS}
        rov.set({"u_top": 0.0})
        assert rov.derivatives(["der(w)"], "u_top") == [0.0]


def warnings_of(log: list[Message]) -> list[str]:
    """Return the warnings without the function that each begins with."""
    return [message.text.rpartition(": ")[2] for message in log if message.status == WARNING]


BEYOND = [
    "it acts as neutral; logged once.",
    "u_r = 2500 saturates at 1900; logged once.",
    "u_l = 500 saturates at 1100; logged once.",
    "voltage = 13 saturates at 14 for the thrust curve bow; logged once.",
    "voltage = 8 saturates at 12 for the thrust curve main; logged once.",
]


def test_a_warning_names_the_end_of_the_range_and_the_thrust_curve(made_once: Made) -> None:
    """The voltages of the two curves are 12 to 16 V and 14 to 20 V. Each warning is given once."""

    def say(rov: AnyInstance) -> list[str]:
        rov.start({**dict.fromkeys(COMMANDS, 0.0), "u_r": 2500.0, "voltage": 16.0})
        for values in ({"u_l": 500.0}, {"voltage": 13.0}, {"u_r": 0.0, "voltage": 8.0}, {"voltage": 25.0}):
            rov.set(values)
        assert "u_l = 0 means that there is no signal: it acts as neutral; logged once." in rov.log[0].text
        return warnings_of(rov.log)

    for version, wrapper in WRAPPERS.items():
        made = made_once(f"ranges{version}", partial(unzipped, RANGES, fmi=version))
        with wrapper(made).instance() as rov:
            assert say(rov) == BEYOND


@pytest.mark.long
def test_a_vehicle_file_with_pulse_widths_is_built_run_and_proved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = THRUST_EFFECTS.read_text(encoding="utf-8").replace("[commands]", f"[commands]\npulse = {[*PULSE]}")
    file, fmu = tmp_path / "vehicle.toml", tmp_path / "delayed.fmu"
    file.write_text(text, encoding="utf-8")
    for table in THRUST_EFFECTS.parent.glob("thrust_*.csv"):
        shutil.copy(table, tmp_path)
    assert main(["build", str(file), "--platform", "host", "-o", str(fmu)]) == 0
    assert "The FMU is valid. In a run, u_l = u_r = 1606 gives u = " in capsys.readouterr().out
    assert main(["prove", str(fmu)]) == 0
