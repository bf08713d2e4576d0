"""Vehicles in MuJoCo and in Gymnasium: the time of a step, and how far the motion is from that of the FMU."""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from statistics import median
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from rov_fmu.bridges.gym import RovVectorEnv
from rov_fmu.bridges.mujoco import load_mujoco
from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import SURGE, YAW
from rov_fmu.report.plots.geometry import hull_size
from rov_fmu.vehicle.vehicle import Vehicle

from .page import Section, duration

H = 0.001
"""The step of the times, s."""
_STEPS = 1000
_FLEET = 1000
"""The vehicles of the environment."""
_TURN = {SURGE: 0.8, YAW: 0.6}
_PUSH = 10.0
"""A force from outside, N."""
_FLUID = """<mujoco>
  <option density="1000" viscosity="0.001" gravity="0 0 0" timestep="{h}"><flag contact="disable"/></option>
  <worldbody><body><freejoint/><inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia}"/>
    <geom type="ellipsoid" size="{size}" fluidshape="{shape}" mass="0"/></body></worldbody>
</mujoco>"""


def section(vehicle: Vehicle, repetitions: int) -> Section:
    """Return the times of a step of 1 ms on one core, the errors after 10 s in a hard turn, and MuJoCo's own fluid."""
    command = vehicle.layout.commands_along(SURGE, 0.3)
    rov = load_mujoco(vehicle)
    rov.model.opt.timestep = H
    for name, value in command.items():
        rov.data.actuator(name).ctrl = value
    none, fluid = (_in_own_fluid(vehicle, shape) for shape in ("none", "ellipsoid"))
    none.opt.density = none.opt.viscosity = 0.0
    environment = RovVectorEnv(vehicle, _FLEET, step=H, draws=False)
    environment.reset(seed=0)
    actions = np.zeros((_FLEET, len(environment.commands)))
    times = {
        "MuJoCo without water, in C": lambda: _in_c(none),
        "MuJoCo with its own fluid, in C": lambda: _in_c(fluid),
        "mj_step of the exported model, without the plug-in": _loop(lambda: mujoco.mj_step(rov.model, alone)),
        "MuJoCo with the plug-in": _loop(rov.step),
        "MuJoCo with the plug-in, 100 steps at once": _loop(lambda: rov.step(100), _STEPS // 100, 100),
        "RovVectorEnv, 1000 vehicles in lanes": _loop(lambda: environment.step(actions), 20, _FLEET),
    }
    alone = mujoco.MjData(rov.model)
    rows = {name: [run() for _ in range(max(repetitions, 3))] for name, run in times.items()}
    turn: Counter[str] = Counter()
    for axis, share in _TURN.items():
        turn.update(vehicle.layout.commands_along(axis, share))
    far = {h: _error(vehicle, turn, h) for h in (0.004, 0.001)}
    quick, fast = _own_fluid(vehicle, fluid)
    return [
        [f"{vehicle.name}: simulators, step 1 ms", "one vehicle"],
        *([name, duration(median(seconds))] for name, seconds in rows.items()),
        *([f"a hard turn of 10 s, plug-in, {1e3 * h:g} ms", f"{1e3 * error:.2g} mm off"] for h, error in far.items()),
        ["MuJoCo's own fluid: acceleration from rest", f"{quick:.2f} times ours"],
        ["MuJoCo's own fluid: speed at 30 % ahead", f"{fast:.2f} times ours"],
    ]


def _loop(step: Callable[[], object], steps: int = _STEPS, vehicles: int = 1) -> Callable[[], float]:
    """Return the function that measures the processor time of a step, s for each vehicle."""

    def run() -> float:
        began = time.process_time()
        for _ in range(steps):
            step()
        return (time.process_time() - began) / steps / vehicles

    return run


def _in_c(model: Any) -> float:
    """Return the processor time of a step of MuJoCo in a loop in C, s."""
    start = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    data = mujoco.MjData(model)
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    began = time.process_time()
    rollout.rollout(model, [data], start[None], nstep=20 * _STEPS)
    return (time.process_time() - began) / (20 * _STEPS)


def _error(vehicle: Vehicle, command: Mapping[str, float], h: float) -> float:
    """Return how far the position after 10 s under a held command is from that of the FMU, m."""
    rov = load_mujoco(vehicle)
    rov.model.opt.timestep = h
    rov.data.qpos[:3] = 0.0
    for name, value in command.items():
        rov.data.actuator(name).ctrl = value
    for _ in range(round(10.0 / h)):
        rov.step()
    axes = [axis for axis in "xyz" if axis in vehicle.layout.pose]
    values = {**vehicle.layout.usual_inputs, **command, **vehicle.layout.at_rest}
    found = simulate(vehicle, [0.0, 10.0], {name: np.array([[value]]) for name, value in values.items()}, axes)
    end = dict(zip(axes, found.values[:, 0, -1].tolist(), strict=True))
    there = np.array([end.get("x", 0.0), -end.get("y", 0.0), -end.get("z", 0.0)])
    return float(np.abs(rov.data.qpos[:3] - there).max())


def _in_own_fluid(vehicle: Vehicle, shape: str) -> Any:
    """Return a rigid body with the vehicle's mass, whose hull MuJoCo takes for an ellipsoid in water."""
    values = vehicle.coefficients
    moments = [values.get(name, values.get("I_r", 0.1)) for name in ("I_p", "I_q", "I_r")]
    size = " ".join(map(str, hull_size(vehicle) / 2.0))
    text = _FLUID.format(h=H, mass=vehicle["m_rov"], inertia=" ".join(map(str, moments)), size=size, shape=shape)
    return mujoco.MjModel.from_xml_string(text)


def _own_fluid(vehicle: Vehicle, model: Any) -> tuple[float, float]:
    """Return the acceleration by a push and the speed under a command with MuJoCo's own fluid, relative to ours."""
    data = mujoco.MjData(model)
    data.xfrc_applied[1, 0] = _PUSH
    mujoco.mj_forward(model, data)
    quick = data.qacc[0] * vehicle.effective_inertia(SURGE) / _PUSH
    data.xfrc_applied[1, 0] = vehicle.force(SURGE, 0.3) * vehicle["alpha_u"]
    for _ in range(round(20.0 / H)):
        mujoco.mj_step(model, data)
    return float(quick), float(data.qvel[0] / vehicle.response(SURGE, 0.3)[0])
