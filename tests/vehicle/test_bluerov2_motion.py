"""The motion of the BlueROV2 Heavy in its plane against DOP853. This file repeats the equations of motion."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import cos, sin, sqrt
from pathlib import Path
from random import Random
from typing import Any

import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.io.toml_file import read_toml
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle
from tests.vehicles import four_axes
from verification.references.fmpy_slave import fmpy_slave

HEAVY = SHIPPED["bluerov2_heavy"]


@dataclass
class Reference:
    """The equations of motion without roll and pitch, with the numbers of a vehicle file.

    They have coupling, lag, net weight, a reverse curve and a dead band.
    """

    file: Mapping[str, Any]
    signs: list[float] = field(default_factory=lambda: [1.0] * 4)
    """The signs of the velocities, constant between two reversals: |v| v becomes s v², which is smooth."""
    targets: list[float] = field(default_factory=list)
    """The steady forces of the thrusters, which their lag approaches."""

    def __post_init__(self) -> None:
        def value(entry: Mapping[str, Any]) -> float:
            return float(entry["value"])

        body, curve = self.file["body"], self.file["curves"]["t200"]
        self.curve = {k: value(q) for k, q in curve.items() if k not in ("description", "electric_current")}
        axes = [{k: value(q) for k, q in self.file["axes"][name].items()} for name in ("surge", "sway", "heave", "yaw")]
        rest = [value(body["m_rov"])] * 3 + [value(body["I_r"])]
        self.M = [inertia + axis["m_a"] for inertia, axis in zip(rest, axes, strict=True)]
        self.A, self.B = ([axis[key] for axis in axes] for key in ("a_d", "b_d"))
        self.load = [0.0, 0.0, value(body["W"]) - value(body["B"]), 0.0]
        self.effects = []
        for thruster in self.file["thruster"]:
            d, p = (np.array(thruster[key]["value"], dtype=float) for key in ("direction", "position"))
            d /= sqrt(d @ d)
            self.effects.append([*d, np.cross(p, d)[2]])

    def hold(self, commands: Sequence[float]) -> None:
        """Set the commands from now on."""
        self.targets = []
        for c in commands:
            m = max(min(abs(c), 1.0) - self.curve["c_0"], 0.0)
            end = "" if c > 0.0 else "_reverse"
            force = self.curve["a_t" + end] * m * m + self.curve["b_t" + end] * m
            self.targets.append(force if c > 0.0 else -force)

    def rates(self, _t: float, y: Any) -> list[float]:
        u, v, w, r, psi = (float(y[n]) for n in (0, 1, 2, 3, 7))
        (M_u, M_v, _, M_r), F = self.M, y[8:].tolist()
        found = []
        for n, velocity in enumerate((u, v, w, r)):
            thrust = sum(e[n] * f for e, f in zip(self.effects, F, strict=True))
            drag = self.signs[n] * self.A[n] * velocity * velocity + self.B[n] * velocity
            found.append((thrust + self.load[n] - drag) / self.M[n])
        found[0] += M_v * v * r / M_u
        found[1] -= M_u * u * r / M_v
        found[3] -= (M_v - M_u) * u * v / M_r
        found += [u * cos(psi) - v * sin(psi), u * sin(psi) + v * cos(psi), w, r]
        return found + [(target - f) / self.curve["T"] for target, f in zip(self.targets, F, strict=True)]

    def advance(self, y: Any, commands: Sequence[float], h: float) -> tuple[Any, int]:
        """Return the state after h seconds, integrated from reversal to reversal, and the number of reversals."""
        self.hold(commands)
        self.signs = [1.0 if x > 0.0 else -1.0 for x in y[:4]]
        t, reversals = 0.0, 0
        while t < h:
            events = [self._reversal(n) for n in range(4)]
            part = solve_ivp(self.rates, (t, h), y, "DOP853", events=events, rtol=1e-13, atol=1e-15)
            assert part.success, part.message
            t, y = part.t[-1], part.y[:, -1].copy()
            for n in (n for n in range(4) if len(part.t_events[n])):
                y[n], self.signs[n] = 0.0, -self.signs[n]
                reversals += 1
                assert self.rates(t, y)[n] * self.signs[n] > 0.0, "the velocity goes through zero"
        return y, reversals

    def _reversal(self, n: int) -> Callable[..., float]:
        def velocity(_t: float, y: Any) -> float:
            return float(y[n])

        velocity.terminal, velocity.direction = True, -self.signs[n]  # type: ignore[attr-defined]
        return velocity


Flown = list[tuple[float, dict[str, float], dict[str, float]]]


def manoeuvre(thrusters: int) -> list[tuple[float, list[float]]]:
    """Return held commands for 30 s, each with its duration: random motions of all axes, some in the dead band."""
    random, held = Random(1898), []
    ends = [0.0, *sorted(random.uniform(0.0, 30.0) for _ in range(23)), 30.0]
    for start, end in pairwise(ends):
        surge, sway, yaw, heave = (random.choice((-1.0, -0.5, -0.2, 0.0, 0.3, 0.6, 1.0)) for _ in range(4))
        commands = [yaw - surge + sway, -yaw - surge - sway, -yaw + surge + sway, yaw + surge - sway]
        commands += [heave + random.uniform(-0.1, 0.1) for _ in range(thrusters - 4)]
        held.append((end - start, [max(-1.0, min(1.0, c + random.uniform(-0.05, 0.05))) for c in commands]))
    return held


@pytest.fixture(scope="module")
def flown() -> Flown:
    """Return the duration, the inputs and the final state of every held command, after the initial state."""
    vehicle = four_axes(load_vehicle(HEAVY))
    assert vehicle.layout.coupled
    assert len(vehicle.layout.lagging) == 8
    names = ("u", "v", "w", "r", "x", "y", "z", "psi", *vehicle.layout.lagging)
    reference = Reference(read_toml(HEAVY, VehicleFileError))
    y = np.array([0.2, -0.1, 0.05, 0.3, 0.0, 0.0, 5.0, 1.0] + 8 * [2.0])
    assert set(names) == set(vehicle.layout.state)
    quiet = dict.fromkeys(vehicle.layout.inputs, 0.0)
    found = [(0.0, quiet, dict(zip(names, y.tolist(), strict=True)))]
    total = 0
    for h, commands in manoeuvre(8):
        y, reversals = reference.advance(y, commands, h)
        inputs = quiet | {f"u_{n}": c for n, c in enumerate(commands, 1)}
        found.append((h, inputs, dict(zip(names, y.tolist(), strict=True))))
        total += reversals
    assert total > 20
    assert abs(found[-1][2]["psi"]) > 3.0
    return found


@pytest.mark.parametrize("longest", [100.0, pytest.param(0.01, marks=pytest.mark.long)])
def test_the_heavy_agrees_with_dop853(flown: Flown, longest: float) -> None:
    rov = four_axes(load_vehicle(HEAVY))
    state, dead = flown[0][2], 0
    for h, inputs, wanted in flown[1:]:
        steps = max(1, round(h / longest))
        for _ in range(steps):
            state = rov.step(inputs, state, h / steps)
        dead += sum(0.0 < abs(c) < 0.0872 for c in inputs.values())
        assert state == pytest.approx(wanted, abs=1e-9, rel=0.0)
    assert dead > 5


@pytest.mark.parametrize("longest", [100.0, 0.01])
def test_its_fmu_agrees_with_dop853(flown: Flown, heavy_dir: Path, longest: float) -> None:
    references = {v.name: v.valueReference for v in fmpy.read_model_description(str(heavy_dir)).modelVariables}
    slave, t = fmpy_slave(heavy_dir), 0.0

    def put(values: Mapping[str, float]) -> None:
        slave.setReal([references[name] for name in values], list(values.values()))

    put(flown[0][2])
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    for h, inputs, wanted in flown[1:]:
        put(inputs)
        steps = max(1, round(h / longest))
        for _ in range(steps):
            slave.doStep(t, h / steps)
            t += h / steps
        state = slave.getReal([references[name] for name in wanted])
        assert dict(zip(wanted, state, strict=True)) == pytest.approx(wanted, abs=1e-9, rel=0.0)
    slave.terminate()
    slave.freeInstance()
