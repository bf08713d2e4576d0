"""Commands as pulse widths: the vehicle moves as one with fractions does at the converted inputs."""

import random

import pytest

from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import SIX, THRUST_EFFECTS, VEHICLES, pulsed, random_inputs, random_state

PULSE = (1100.0, 1480.0, 1900.0)
ROVS = {
    "thrust": load_vehicle(THRUST_EFFECTS),  # with tables, a dead band, a fin and a dead time
    "mixed": next(rov for rov in VEHICLES.values() if rov.layout.mix),
    "six axes": SIX,
}


@pytest.fixture(params=ROVS)
def rov(request: pytest.FixtureRequest) -> Vehicle:
    """Return a vehicle whose commands are fractions."""
    return ROVS[request.param]


def pulses_of(rng: random.Random, rov: Vehicle) -> tuple[dict[str, float], dict[str, float]]:
    """Return random inputs with pulse widths, some of them far beyond full thrust, and the same ones with fractions."""
    low, neutral, high = PULSE
    inputs = random_inputs(rng, rov)
    pulses = {name: rng.choice((0.0, neutral, *[rng.uniform(900.0, 2100.0)] * 8)) for name in rov.layout.commands}

    def fraction(pulse: float) -> float:
        if pulse == 0.0:  # there is no signal
            return 0.0
        return (pulse - neutral) / (high - neutral if pulse > neutral else neutral - low)

    return inputs | pulses, inputs | {name: fraction(pulse) for name, pulse in pulses.items()}


def test_every_step_is_that_of_the_fractions_bit_for_bit(rov: Vehicle) -> None:
    rng, of_pulses = random.Random(1), pulsed(rov, PULSE)
    lines = of_pulses.memory(), rov.memory()
    state = random_state(rng, rov)
    for n in range(12):
        pulses, fractions = pulses_of(rng, rov)
        found = lines[0].step(of_pulses, pulses, state, 0.07 * n, 0.07)
        assert found == lines[1].step(rov, fractions, state, 0.07 * n, 0.07)
        assert of_pulses.derivatives(pulses, state) == rov.derivatives(fractions, state)
        assert of_pulses.calculated(pulses, state) == rov.calculated(fractions, state)
        state = {name: found[name] for name in state}
