"""The FMUs of FMI 2.0 and 3.0 give the same values to the bit."""

import random

import pytest

from tests import fmi2, fmi3
from tests.fmi import AnyInstance, reals

_FOLDERS = {"videoray": ("videoray_dir", "videoray3_dir"), "everything": ("everything_dir", "everything3_dir")}
"""The fixtures with the FMUs of two vehicles in both versions."""


@pytest.fixture(scope="module", params=_FOLDERS)
def both(request: pytest.FixtureRequest) -> tuple[fmi2.Fmu, fmi3.Fmu]:
    """Return both FMUs of a vehicle."""
    two, three = map(request.getfixturevalue, _FOLDERS[request.param])
    return fmi2.Fmu(two), fmi3.Fmu(three)


def inputs(rov: AnyInstance, rng: random.Random) -> dict[str, float]:
    return {name: rng.choice([0.0, rng.uniform(-1.2, 1.2), rng.uniform(-1.2, 1.2)]) for name in rov.fmu.inputs}


def run(rov: AnyInstance, steps: int) -> list[bytes]:
    """Return all values after each of many random steps with random commands and tuning."""
    rng, t, seen = random.Random(6), 0.0, []
    for _ in range(steps):
        h = 10.0 ** rng.uniform(-4.0, 0.8)
        rov.set({**inputs(rov, rng), f"beta_{rov.fmu.states[0]}": rng.uniform(0.5, 1.0)})
        rov.step(t, h)
        t += h
        read = rov.get([name for name in rov.fmu.variables if name != "time"])
        read += rov.rates(rov.fmu.outputs)
        seen.append(bytes(reals(*read, rov.time())))
    return seen


@pytest.mark.parametrize("steps", [300, pytest.param(30_000, marks=pytest.mark.weekly)])
def test_co_simulation_gives_the_same_bits(both: tuple[fmi2.Fmu, fmi3.Fmu], steps: int) -> None:
    runs = []
    for fmu in both:
        with fmu.instance() as rov:
            rov.start({"psi": 0.5})
            runs.append(run(rov, steps))
    assert runs[0] == runs[1]
    assert len(set(runs[0])) == steps
