"""A model predictive controller that holds station in a current: docs/controller.md shows it at work."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import casadi
import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

import rov_fmu

Array = np.ndarray[Any, Any]

vehicle = rov_fmu.load("videoray_refit")
layout = vehicle.layout
STATES, COMMANDS, CURRENT = list(layout.state), list(layout.commands), ["V_N", "V_E"]
PLACE = {name: n for n, name in enumerate(STATES)}
H, HORIZON, MOST = 0.5, 20, 0.7
"""The step (s), the steps of the horizon, and the largest command."""
START = {"x": 2.0, "y": -1.0, "z": 1.0, "psi": 1.0}
TRUE, BELIEVED = np.array([-0.25, 0.15]), np.array([-0.22, 0.12])
"""The current, and what the controller takes it for, m/s."""

# The motion over a step: four steps of Runge and Kutta with the equation of the vehicle
x, u, current = (casadi.SX.sym(name, size) for name, size in (("x", len(STATES)), ("u", len(COMMANDS)), ("V", 2)))
inputs = dict(zip([*COMMANDS, *CURRENT], [*casadi.vertsplit(u), *casadi.vertsplit(current)], strict=True))
rates = casadi.Function("rates", [x, u, current], [vehicle.rates(x, vehicle.forces(inputs))])
after, h = x, H / 4
for _ in range(4):
    k1 = rates(after, u, current)
    k2 = rates(after + 0.5 * h * k1, u, current)
    k3 = rates(after + 0.5 * h * k2, u, current)
    k4 = rates(after + h * k3, u, current)
    after = after + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
step = casadi.Function("step", [x, u, current], [after]).map(HORIZON)

# The commands that keep the vehicle closest to its target over the horizon
X, U = casadi.SX.sym("X", len(STATES), HORIZON + 1), casadi.SX.sym("U", len(COMMANDS), HORIZON)
position, turning = X[[PLACE[name] for name in "xyz"], 1:], X[PLACE["r"], 1:]
cost = casadi.sumsqr(position) + 0.02 * casadi.sumsqr(turning) + 0.02 * casadi.sumsqr(U)
cost += 0.05 * casadi.sumsqr(U[:, 1:] - U[:, :-1])
follows = step(X[:, :-1], U, casadi.repmat(current, 1, HORIZON)) - X[:, 1:]
problem = {
    "x": casadi.vertcat(casadi.vec(X), casadi.vec(U)),
    "p": casadi.vertcat(x, current),
    "f": cost,
    "g": casadi.vertcat(X[:, 0] - x, casadi.vec(follows)),
}
quiet: dict[str, Any] = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 100}
solver = casadi.nlpsol("solver", "ipopt", problem, quiet)
bounds = np.concatenate((np.full(X.numel(), np.inf), np.full(U.numel(), MOST)))

_FOLDER = TemporaryDirectory(ignore_cleanup_errors=True)


@cache
def unpacked() -> str:
    """Return the folder of the FMU, which is built once."""
    folder = Path(_FOLDER.name)
    return str(fmpy.extract(vehicle.build(folder / "rov.fmu", platforms="host").path, folder / "rov"))


def plan(state: Array, guess: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the predicted states (steps x states) and the commands (steps x commands) of the horizon."""
    start = np.concatenate([part.ravel() for part in guess])
    parameters = np.concatenate((state, BELIEVED))
    solved = solver(x0=start, p=parameters, lbx=-bounds, ubx=bounds, lbg=0.0, ubg=0.0)
    if not solver.stats()["success"]:
        raise RuntimeError(solver.stats()["return_status"])
    states, commands = np.split(np.array(solved["x"])[:, 0], [X.numel()])
    return states.reshape(-1, len(STATES)), commands.reshape(-1, len(COMMANDS))


def fly(coefficients: Mapping[str, float], seconds: float) -> tuple[Array, Array, Array]:
    """Fly the FMU. Return the states at all times, the commands of all steps, and the times that the solutions took."""
    description = fmpy.read_model_description(unpacked())
    number = {variable.name: variable.valueReference for variable in description.modelVariables}
    plant = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=unpacked(),
        instanceName="plant",
    )
    plant.instantiate()
    plant.setupExperiment(startTime=0.0)
    values = {**coefficients, **START, **dict(zip(CURRENT, TRUE, strict=True))}
    plant.setReal([number[name] for name in values], values.values())
    plant.enterInitializationMode()
    plant.exitInitializationMode()
    states = [np.array([START.get(name, 0.0) for name in STATES])]
    commands, times = list[Array](), list[float]()
    guess = np.tile(states[0], (HORIZON + 1, 1)), np.zeros((HORIZON, len(COMMANDS)))
    for n in range(round(seconds / H)):
        begin = perf_counter()
        planned, chosen = plan(states[-1], guess)
        times.append(perf_counter() - begin)
        guess = np.vstack([planned[1:], planned[-1:]]), np.vstack([chosen[1:], chosen[-1:]])
        commands.append(chosen[0])
        plant.setReal([number[name] for name in COMMANDS], commands[-1])
        plant.doStep(n * H, H)
        states.append(np.array(plant.getReal([number[name] for name in STATES])))
    plant.terminate()
    plant.freeInstance()
    return np.array(states), np.array(commands), np.array(times)
