"""An FMU whose commands are pulse widths behaves as one with fractions at the converted inputs."""

import random
from dataclasses import replace

import pytest

from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.conftest import Made, unzipped
from tests.equation.thrust.test_thrust_effects import immediate
from tests.fmi import CONTINUOUS, MODEL_EXCHANGE, WARNING, Fmu
from tests.fmu.calls.conftest import WRAPPERS
from tests.vehicles import THRUST_EFFECTS, pulsed

PULSE = (1100.0, 1480.0, 1900.0)
DELAYED = load_vehicle(THRUST_EFFECTS)
FRACTIONS = replace(immediate(DELAYED), identifier="fractions")
PULSES = replace(pulsed(FRACTIONS, PULSE), identifier="pulses")


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


def test_a_warning_names_the_end_of_the_range_and_what_a_missing_signal_means(fmus: Pair) -> None:
    with fmus[0].instance() as rov:
        rov.start({**dict.fromkeys(COMMANDS, 0.0), "u_r": 2500.0})
        rov.set({"u_l": 500.0})
        first, *others = [message.text for message in rov.log if message.status == WARNING]
    assert "u_l = 0 means that there is no signal: it acts as neutral; logged once." in first
    assert [text.rpartition(": ")[2] for text in others] == [
        "u_r = 2500 saturates at 1900; logged once.",
        "u_l = 500 saturates at 1100; logged once.",
    ]
