"""A vehicle in MuJoCo moves as its FMU does, and contacts, loads and payloads feel its whole mass.

The motion of the FMU comes from its C code, and mass matrices from `verification/references`, which uses no formula of
the package.
"""

import atexit
import importlib
import re
import sys
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

import rov_fmu
from rov_fmu.bridges.gym import RovVectorEnv
from rov_fmu.bridges.mujoco import load_mujoco, mujoco_files, mujoco_texts
from rov_fmu.bridges.mujoco.plugin import show
from rov_fmu.c.compile import host_platform
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.interface.arguments import with_axes
from rov_fmu.interface.model import VehicleModel
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import InputError
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, without_surface
from tests.commands import BARE, ROOT, python
from tests.often import spread
from tests.vehicles import VEHICLES, frictionless, in_waves, passed, tied
from verification.references.rigid_body import Body
from verification.references.rigid_vehicle import body

mujoco: Any = importlib.import_module("rov_fmu.bridges.mujoco.plugin").mujoco
REFERENCES = ROOT / "verification" / "references" / "vehicles"
FILES = {
    **SHIPPED,
    **{name: ROOT / "tests" / "vehicle" / f"{name}.toml" for name in ("everything", "six_axes", "thrust_effects")},
    **{name: REFERENCES / f"{name}.toml" for name in ("every_option", "identified", "thrust")},
}
HOST = [*filter(None, [host_platform(fmi=3)])]
FLIP = np.array([1.0, -1.0, -1.0])
"""The signs of the components in MuJoCo's frames, relative to those of the FMU."""
TILTS = {
    "level": (1.0, 0.0, 0.0, 0.0),
    "45° bow up": (np.cos(np.pi / 8), 0.0, -np.sin(np.pi / 8), 0.0),
    "askew": (0.8, 0.3, -0.4, 0.33),
}


_UNTIL_THE_END = ExitStack()
atexit.register(_UNTIL_THE_END.close)


def package_of(vehicle: Vehicle) -> ModuleType:
    """Return the package of a vehicle, written to a folder and imported from there as users do."""
    folder = Path(_UNTIL_THE_END.enter_context(temporary_folder(f"{vehicle.identifier}_")))
    package = folder.name
    for name, file in mujoco_files(mujoco_texts(vehicle, package, {"Where it holds": ["Here."]}, {}), HOST).items():
        (folder / name).write_bytes(file.encode() if isinstance(file, str) else file)
    sys.path.insert(0, str(folder.parent))
    try:
        return importlib.import_module(package)
    finally:
        sys.path.remove(str(folder.parent))


@cache
def loaded(name: str) -> tuple[VehicleModel, ModuleType]:
    vehicle = without_surface(rov_fmu.load(FILES[name]))
    return vehicle, package_of(vehicle)


def scene(package: ModuleType, timestep: float = 0.001) -> Any:
    """Return the world of a vehicle, to which a test may add."""
    spec = mujoco.MjSpec.from_file(str(package.FOLDER / "scene.xml"))
    spec.option.timestep = timestep
    return spec


def turned(rov: Any, quaternion: tuple[float, ...]) -> None:
    rov.data.qpos[3:7] = np.array(quaternion) / np.linalg.norm(quaternion)


def rigid(vehicle: Vehicle) -> Body:
    """Return a vehicle without commands as the rigid body of the reference."""
    usual = vehicle.layout.usual_inputs
    return body(vehicle, {**usual, **{delayed_name(name): usual[name] for name in vehicle.layout.commands}})


def mass_of(vehicle: Vehicle, rov: Any) -> Array:
    """Return the mass matrix of a vehicle in MuJoCo's coordinates: the velocity in the world, the rates in the body."""
    turn = np.eye(6)
    turn[:3, :3] = FLIP[:, None] * rov.data.xmat[rov.body].reshape(3, 3).T
    turn[3:, 3:] = np.diag(FLIP)
    return np.asarray(turn.T @ rigid(vehicle).mass.astype(float) @ turn)


# ---- The motion ------------------------------------------------------------------------------------------------------


def commands(vehicle: Vehicle, seconds: float) -> tuple[Array, dict[str, Array]]:
    """Return switches every half second, and random commands up to half of the full ones."""
    random, times = np.random.default_rng(3), np.arange(0.0, seconds, 0.5)
    layout = vehicle.layout
    return times, {
        name: np.array([layout.command_of(x) for x in random.uniform(-0.5, 0.5, len(times))])
        for name in layout.commands
    }


CURRENT = {"V_N": 0.2, "V_E": -0.1}


EULER = mujoco.mjtIntegrator.mjINT_EULER
IMPLICIT = (mujoco.mjtIntegrator.mjINT_IMPLICIT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
TURNS = ({"surge": 0.8, "yaw": 0.6}, dict.fromkeys(("surge", "sway", "heave", "yaw"), 1.0))
"""Turns under held commands along the axes that a vehicle has."""


def turn(vehicle: Vehicle, along: dict[str, float], seconds: float) -> tuple[Array, dict[str, Array]]:
    """Return held commands of a turn, in the form of `commands`."""
    fractions = {axis: np.array(share) for axis, share in along.items() if axis in vehicle.layout.by_name}
    times = np.arange(0.0, seconds, 0.5)
    return times, {name: np.full(len(times), value) for name, value in with_axes(vehicle.layout, fractions).items()}


def error(
    name: str, h: float, seconds: float = 10.0, along: dict[str, float] | None = None, integrator: int = EULER
) -> float:
    """Return the largest difference of positions, m, and of the attitude, in units of half the square of an angle.

    The commands are random, or those of a turn.
    """
    vehicle, package = loaded(name)
    switches, given = turn(vehicle, along, seconds) if along else commands(vehicle, seconds)
    current = {axis: speed for axis, speed in CURRENT.items() if axis in vehicle.layout.inputs}
    held = {axis: np.full(len(switches), speed) for axis, speed in current.items()}
    times = np.arange(0.0, seconds + 1e-9, 0.1)
    with np.errstate(all="ignore"):
        run = vehicle.simulate(times, {"time": switches, **given, **held})
    rov = package.load()
    rov.model.opt.timestep, rov.model.opt.integrator = h, integrator
    rov.model.geom_contype[:] = 0  # there is no sea bed
    rov.inputs.update(current)
    rov.data.qpos[:3] = 0.0
    rov.data.qvel[:2] = current.get("V_N", 0.0), -current.get("V_E", 0.0)  # at rest in the water
    actuators = [rov.model.actuator(u).id for u in given]
    worst, steps = 0.0, round(0.1 / h)
    for n, row in enumerate(np.repeat(np.array([*given.values()]).T, 5, axis=0)):
        rov.data.ctrl[actuators] = row
        for _ in range(steps):
            rov.step()
        place = [run[axis][n + 1] if axis in run else 0.0 for axis in "xyz"]
        worst = max(worst, float(np.abs(rov.data.qpos[:3] - FLIP * place).max()))
        if "psi" in run and "eta" not in run:
            heading = np.array([np.cos(run["psi"][n + 1] / 2.0), 0.0, 0.0, -np.sin(run["psi"][n + 1] / 2.0)])
            worst = max(worst, 1.0 - abs(float(heading @ rov.data.qpos[3:7])))
        if "eta" in run:
            e, a, b, c = (run[part][n + 1] for part in ("eta", "epsilon_1", "epsilon_2", "epsilon_3"))
            worst = max(worst, 1.0 - abs(float(np.array([e, a, -b, -c]) @ rov.data.qpos[3:7])))
    return worst


may_turn_over = pytest.mark.filterwarnings(
    *(f"ignore:.*{words}:UserWarning" for words in ("turns over", "no signal", "saturate"))
)


def moves(test: Any) -> Any:
    """Run a test for all vehicles, some of which turn over."""
    return may_turn_over(pytest.mark.parametrize("name", FILES)(test))


@moves
def test_it_moves_as_the_fmu_with_errors_of_second_order(name: str) -> None:
    coarse, fine = error(name, 0.005, 2.0), error(name, 0.0025, 2.0)
    assert coarse < 1e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.3)


@pytest.mark.parametrize("name", ["bluerov2", "thrust_effects"])
def test_a_push_is_the_load_of_the_fmu_with_errors_of_second_order(name: str) -> None:
    vehicle, package = loaded(name)
    switches, given = turn(vehicle, {"surge": 0.5}, 2.0)
    run = vehicle.simulate([0.0, 2.0], {"time": switches, **given, "X_ext": np.full(len(switches), 20.0)})

    def off(h: float) -> float:
        rov = package.load()
        rov.model.opt.timestep = h
        rov.model.geom_contype[:] = 0
        rov.data.qfrc_applied[0] = 20.0
        for command, values in given.items():
            rov.data.actuator(command).ctrl = values[0]
        rov.step(round(2.0 / h))
        return float(abs(rov.data.qpos[0] - run["x"][-1]))

    coarse, fine = off(0.02), off(0.01)
    assert coarse < 1e-2
    assert coarse / fine == pytest.approx(4.0, rel=0.3)


def test_it_has_no_inputs_of_waves() -> None:
    vehicle, _ = loaded("bluerov2_heavy")
    texts, plain = (mujoco_texts(rov, "heavy", {}, {}) for rov in (in_waves(vehicle), vehicle))
    assert texts == plain


def test_a_current_that_changes_passes_it_as_the_fmu_of_such_a_vehicle() -> None:
    """The axes are those that both have, and the motion is within 1 mm. One that is carried is 0.2 m away."""
    vehicle, package = loaded("bluerov2_heavy")
    times, start = np.arange(0.0, 4.01, 1.0), {"u": 0.2, "psi": 0.5}
    current = {name: np.where(times < 1.0, 0.0, speed) for name, speed in CURRENT.items()}
    rov = package.load()
    rov.model.opt.timestep = 0.002
    rov.model.geom_contype[:] = 0
    turned(rov, (np.cos(0.25), 0.0, 0.0, -np.sin(0.25)))
    rov.data.qpos[:3], rov.data.qvel[:2] = 0.0, (0.2 * np.cos(0.5), -0.2 * np.sin(0.5))
    for n in range(4):
        rov.inputs.update({name: float(row[n]) for name, row in current.items()})
        for _ in range(500):
            rov.step()
    for one, is_there in ((passed(vehicle), True), (vehicle, False)):
        run = one.simulate(times, current, start=start)
        place = FLIP * [run[axis][-1] for axis in "xyz"]
        assert (np.abs(rov.data.qpos[:3] - place).max() < 1e-3) == is_there


@may_turn_over
@pytest.mark.parametrize("integrator", IMPLICIT, ids=lambda one: one.name)
@pytest.mark.parametrize("name", ["six_axes", "every_option"])
def test_an_implicit_integrator_moves_it_as_euler_does(name: str, integrator: int) -> None:
    """Such integrators subtract gyroscopic forces at the end of the step, which alone makes the error 30 times."""
    explicit = error(name, 0.004, 2.0, TURNS[0])
    assert error(name, 0.004, 2.0, TURNS[0], integrator) == pytest.approx(explicit, rel=1e-3)


@may_turn_over
@pytest.mark.parametrize("along", TURNS, ids=lambda along: f"{len(along)} axes")
@pytest.mark.parametrize("name", SHIPPED)
def test_in_hard_turns_of_ten_seconds_it_is_within_a_third_of_a_millimetre_at_4_ms(
    name: str, along: dict[str, float]
) -> None:
    """This is the figure of docs/simulator.md. Errors of second order are a sixteenth of it at 1 ms."""
    assert error(name, 0.004, 10.0, along) < 0.3e-3


@pytest.mark.parametrize("arm", ["none", "welded", "hinged"])
@pytest.mark.parametrize("integrator", [EULER, *IMPLICIT], ids=lambda one: one.name)
def test_a_payload_that_an_integrator_treats_as_implicit_leaves_the_order(integrator: int, arm: str) -> None:
    """A light payload, welded or on a joint, changes which forces `implicitfast` treats as implicit."""
    vehicle, package = loaded("bluerov2_heavy")

    def velocity(h: float) -> Array:
        spec = scene(package, h)
        spec.option.integrator = integrator
        if arm != "none":
            child = spec.body(vehicle.identifier).add_body(pos=[0.2, 0.0, 0.0], gravcomp=1.0)
            child.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0.0, 0.0], mass=1e-6, contype=0)
            if arm == "hinged":
                child.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0])
        rov = package.Rov(spec.compile())
        rov.data.qvel[:6] = 0.3, 0.2, 0.1, 0.5, -0.4, 0.7
        rov.data.qfrc_applied[3:6] = 0.5, -1.0, 1.5
        while rov.data.time < 0.4 - 0.5 * h:
            rov.step()
        return np.asarray(rov.data.qvel[:6])

    coarse, middle, fine = map(velocity, (0.02, 0.01, 0.005))
    assert np.abs(coarse - middle).max() / np.abs(middle - fine).max() == pytest.approx(4.0, rel=0.25)


def test_ballast_changes_the_motion_as_in_the_fmu() -> None:
    vehicle, package = loaded("bluerov2")
    ballast = {"m_rov": 14.0, "F_0_w": 3.0, "alpha_w": 0.5, "beta_u": 0.8, "health_1": 0.3, "health_5": 0.0}
    rov = package.load()
    rov.data.qpos[:3] = 0.0
    rov.coefficients |= ballast
    rov.data.ctrl[:] = 0.2
    while rov.data.time < 0.999:
        rov.step()
    run = vehicle.with_(**ballast).simulate([0.0, 1.0], dict.fromkeys(vehicle.layout.commands, 0.2))
    assert rov.data.qpos[:3] == pytest.approx(FLIP * [run[axis][-1] for axis in "xyz"], abs=1e-5)
    assert rov.forces["F_1"] == pytest.approx(run["F_1"][-1], rel=1e-6)


@pytest.mark.parametrize("name", ["bluerov2", "bluerov2_heavy", "videoray"])
def test_the_ballast_of_the_readme_sinks_as_lead_in_water(name: str) -> None:
    """Against m z'' = 0.5 kg (1 - 1/11.34) g - drag, with the mass of the ballast and with added mass."""
    vehicle, package = loaded(name)
    rov = package.load()
    rov.model.geom_contype[:] = 0
    rov.coefficients.update({key: 0.0 for key in rov.coefficients if key.startswith("F_0")})
    if "W" in rov.coefficients:
        rov.coefficients["B"] = rov.coefficients["W"]
    lines = re.findall(
        r"`(rov\.\w+\[\"\w+\"\] \+= [\d.]+)`", (package.FOLDER / "README.md").read_text(encoding="utf-8")
    )
    assert len(lines) >= 2
    for line in lines:
        exec(line, {"rov": rov})
    pull, depth, speed, h = 0.5 * (1.0 - 1.0 / 11.34) * 9.80665, 0.0, 0.0, 1e-4
    mass = (vehicle["m_rov"] + 0.5 + vehicle.coefficients.get("m_a_w", 0.0)) / vehicle["beta_w"]
    for _ in range(20_000):
        speed += h * (pull - vehicle["a_d_w"] * speed**2 - vehicle["b_d_w"] * speed) / mass
        depth += h * speed
    rov.step(1000)
    assert depth > 0.1
    assert -2.0 - rov.data.qpos[2] == pytest.approx(depth, rel=2e-3)


@pytest.mark.parametrize("time", [0.0, 0.2, 10.0, None])
def test_a_reset_of_it_or_to_a_keyframe_of_any_time_stops_the_thrusters(time: float | None) -> None:
    """Also what waits for the dead time is forgotten, and the forces from outside of the last step."""
    _, package = loaded("every_option")
    spec = scene(package)
    spec.add_key(name="start", time=time or 0.0)
    model = spec.compile()

    def drift(rov: Any) -> Array:
        if time is None:
            rov.reset()
            rov.data.qpos[:], rov.data.qvel[:], rov.data.ctrl[:], rov.data.qfrc_applied[:] = model.qpos0, 0.0, 0.0, 0.0
        else:
            mujoco.mj_resetDataKeyframe(model, rov.data, 0)
        rov.step(20)
        return np.array([*rov.data.qpos, *rov.data.qvel])

    flown = package.Rov(model)
    flown.data.ctrl[:] = 0.5 * flown.model.actuator_ctrlrange[:, 1]
    flown.data.qfrc_applied[:6] = 1.0
    flown.step(200)
    assert (drift(flown) == drift(package.Rov(model))).all()


# ---- The mass --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("payload", [0.0, 2.0])
@pytest.mark.parametrize("name", ["bluerov2_heavy", "every_option", "six_axes"])
def test_a_force_from_outside_feels_the_whole_mass_and_that_of_a_payload(name: str, payload: float, tilt: str) -> None:
    vehicle, package = loaded(name)
    spec, at, wrench = scene(package), np.array([0.1, 0.05, -0.2]), np.array([10.0, 3.0, -4.0, 1.0, 0.5, -0.3])
    if payload:
        child = spec.body(vehicle.identifier).add_body(pos=at, gravcomp=1.0)
        child.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0.0, 0.0], mass=payload, contype=0, conaffinity=0)

    def acceleration(*forces: float) -> Array:
        rov = package.Rov(spec.compile())
        turned(rov, TILTS[tilt])
        rov.data.qfrc_applied[:6] = forces
        rov.step()
        whole = mass_of(vehicle, rov)
        if payload:
            cross = np.cross(np.eye(3), at)
            own = payload * np.block([[np.eye(3), -cross], [cross, -cross @ cross + 0.4 * 0.05**2 * np.eye(3)]])
            turn = np.eye(6)
            turn[:3, :3] = rov.data.xmat[rov.body].reshape(3, 3).T
            whole = whole + turn.T @ own @ turn
        return np.asarray(whole @ rov.data.qacc[:6])

    assert acceleration(*wrench) - acceleration(*np.zeros(6)) == pytest.approx(wrench, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("name", ["bluerov2_heavy", "six_axes"])
def test_a_wall_feels_mass_and_added_mass(name: str, tilt: str) -> None:
    """Without weight and drag, the momentum of body and water, R M nu, changes by the impulse of the wall alone."""
    vehicle, package = loaded(name)
    still = frictionless(vehicle).with_(**{name: 0.0 for name in ("W", "B") if name in vehicle.coefficients})
    spec = scene(package, 0.0005)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 3.0, 3.0], pos=[0.5, 0.0, -2.0])
    rov = package.Rov(spec.compile(), **still.coefficients)
    turned(rov, TILTS[tilt])
    rov.data.qvel[0] = 0.5

    def momentum() -> Array:
        mujoco.mj_kinematics(rov.model, rov.data)
        return np.asarray(mass_of(still, rov) @ rov.data.qvel)[:3]

    before, impulse = momentum(), np.zeros(3)
    for _ in range(2000):
        rov.step()
        impulse += 0.0005 * rov.data.qfrc_constraint[:3]
    assert impulse[0] < -0.5 * 13.5
    assert momentum() - before == pytest.approx(impulse, abs=1e-3 * abs(impulse[0]))


@pytest.mark.parametrize("name", ["bluerov2_heavy", "every_option", "videoray"])
def test_a_vehicle_that_lacks_an_axis_is_held_along_it(name: str) -> None:
    vehicle, package = loaded(name)
    rov = package.load()
    rov.data.qvel[:] = 0.1, 0.05, 0.05, 0.2, 0.2, 0.2
    for _ in range(1000):
        rov.data.xfrc_applied[rov.body] = 5.0, 5.0, 0.0, 1.0, 1.0, 0.0
        rov.step()
    held = [n for n, v in enumerate("uvwpqr") if v not in vehicle.layout.velocities]
    R = rov.data.xmat[rov.body].reshape(3, 3)
    nu = np.concatenate([R.T @ rov.data.qvel[:3], rov.data.qvel[3:]])
    assert nu[held] == pytest.approx(0.0, abs=5e-4)
    if 3 in held:
        assert R[2, 2] == pytest.approx(1.0, abs=1e-9)
    assert np.abs(np.delete(nu, held)).max() > 0.05


# ---- Energy and stability --------------------------------------------------------------------------------------------


def energy(vehicle: Vehicle, rov: Any) -> float:
    """Return the kinetic energy of body and water, and the potential energy of weight and buoyancy, J.

    It is 0 at rest if both are equal and the centre of buoyancy is above that of mass.
    """
    mujoco.mj_kinematics(rov.model, rov.data)
    of = rigid(vehicle)
    lever = FLIP * (of.weight * of.centre_of_gravity - of.buoyancy * of.centre_of_buoyancy).astype(float)
    potential = rov.data.xmat[rov.body][6:] @ lever + np.linalg.norm(lever)
    return float(0.5 * rov.data.qvel @ mass_of(vehicle, rov) @ rov.data.qvel + potential)


@pytest.mark.parametrize("name", ["bluerov2_heavy", "six_axes"])
def test_the_energy_of_a_vehicle_without_thrust_does_not_grow(name: str) -> None:
    """With drag it falls; without drag, weight and buoyancy rock the vehicle, and it stays."""
    vehicle, package = loaded(name)
    loads = {key: 0.0 for key in vehicle.coefficients if key.startswith("F_0")}
    vehicle = vehicle.with_(**loads, B=vehicle["W"])
    for some, most, least in ((vehicle, 0.5, 0.0), (frictionless(vehicle), 1.0001, 0.9999)):
        rov = package.load(**some.coefficients)
        rov.model.opt.timestep = 0.004
        rov.model.geom_contype[:] = 0
        turned(rov, TILTS["askew"])
        rov.data.qvel[:] = 0.5, 0.3, -0.2, 0.4, -0.3, 0.5
        energies = [energy(some, rov)]
        for _ in range(40):
            for _ in range(25):
                rov.step()
            energies.append(energy(some, rov))
        assert np.diff(energies).max() < 1e-5 * energies[0]
        assert least < energies[-1] / energies[0] < most


def tumble(name: str, steps: int) -> tuple[float, int]:
    """Let a vehicle tumble between walls under random commands. Return its largest velocity, and the contacts."""
    vehicle, package = loaded(name)
    spec, layout = scene(package, 0.004), vehicle.layout
    for n in range(8):
        angle = n * np.pi / 4.0
        at, facing = (
            [0.8 * np.cos(angle), 0.8 * np.sin(angle), -2.0],
            [np.cos(angle / 2.0), 0.0, 0.0, np.sin(angle / 2.0)],
        )
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 1.0, 2.0], pos=at, quat=facing)
    for height in (-1.4, -2.6):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[3.0, 3.0, 0.1], pos=[0.0, 0.0, height])
    rov, random = package.Rov(spec.compile()), np.random.default_rng(0)
    fastest, contacts = 0.0, 0
    for n in range(steps):
        if n % 10 == 0:
            rov.data.ctrl[:] = [layout.command_of(x) for x in random.uniform(-1.0, 1.0, len(rov.data.ctrl))]
        rov.step()
        fastest, contacts = max(fastest, float(np.abs(rov.data.qvel).max())), contacts + rov.data.ncon
    assert rov.data.time == pytest.approx(0.004 * steps), "MuJoCo resets a simulation that becomes unstable"
    assert not any(warning.number for warning in rov.data.warning)
    assert np.abs(rov.data.qpos[:3] - [0.0, 0.0, -2.0]).max() < 1.0, "it is still between the walls"
    return fastest, contacts


@pytest.mark.parametrize(
    "steps", [pytest.param(20_000, marks=pytest.mark.long), pytest.param(100_000, marks=pytest.mark.weekly)]
)
@pytest.mark.parametrize("name", FILES)
def test_contacts_stay_finite_for_many_steps(name: str, steps: int) -> None:
    fastest, contacts = tumble(name, steps)
    assert fastest < 20.0
    assert contacts


# ---- What it refuses -------------------------------------------------------------------------------------------------


def _without_joint(spec: Any) -> None:
    spec.delete(spec.joint("videoray"))


def _without_child(spec: Any) -> None:
    spec.delete(spec.body("videoray_thrusters"))


def _with_gravity(spec: Any) -> None:
    spec.body("videoray").gravcomp = 0.0


def _with_fluid(spec: Any) -> None:
    spec.option.density = 1000.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_without_joint, "body videoray: must be in <worldbody> and have a <freejoint>"),
        (_without_child, "body videoray: must contain another body"),
        (_with_gravity, 'body videoray: must have gravcomp="1"'),
        (_with_fluid, "option: density and viscosity must be 0"),
    ],
)
def test_a_model_that_the_equation_cannot_move_is_one_line(change: Any, message: str) -> None:
    _, package = loaded("videoray")
    spec = scene(package)
    change(spec)
    with pytest.raises(ValueError, match=message):
        package.Rov(spec.compile())


def test_a_mujoco_whose_contacts_would_not_feel_the_added_mass_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco.MjData, "qM", None, raising=False)
    with pytest.raises(ValueError, match=r"^MuJoCo .*: must be 3\.17 or later"):
        loaded("videoray")[1].load()


def test_coefficients_that_no_body_has_together_are_one_line() -> None:
    rov = loaded("every_option")[1].load()
    rov.step()
    rov.coefficients["z_G"] = 50.0
    with pytest.raises(ValueError, match=r"^coefficients: the mass matrix must be positive definite"):
        rov.step()


def test_an_unknown_coefficient_or_input_is_one_line() -> None:
    _, package = loaded("videoray")
    with pytest.raises(ValueError, match=r"^a_d_v: the vehicle has no such coefficient or input$"):
        package.load(a_d_v=1.0)
    rov = package.load()
    with pytest.raises(ValueError, match=r"^Y_ext: the vehicle has no such coefficient or input$"):
        rov.inputs["Y_ext"] = 1.0


def test_a_vehicle_without_thrusters_moves_by_loads() -> None:
    bare = rov_fmu.load(BARE)
    rov = package_of(bare.with_(replace(bare.layout, thrusters=(), curves=()))).load()
    rov.inputs["Z_ext"] = 5.0
    rov.step()
    assert rov.data.qacc[2] == pytest.approx(-5.0 / bare["m_rov"], rel=1e-2)
    assert rov.forces == {}
    assert rov.model.actuator("memory").actnum[0] == rov.model.na == rov.model.nu * 7


def test_a_simulation_that_becomes_unstable_begins_anew(tmp_path: Path) -> None:
    rov = loaded("bluerov2")[1].load()
    start = rov.data.qpos.copy()
    rov.data.ctrl[:] = 1.0
    rov.step()
    rov.data.qfrc_applied[0] = 1e13
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(tmp_path)  # MuJoCo writes a log there
        rov.step()
    assert rov.data.time == 0.002, "it has begun anew, and taken a step"
    assert not any(rov.forces.values()), "the thrusters stand still"
    assert rov.data.qpos == pytest.approx(start, abs=1e-3)


@pytest.mark.parametrize("name", spread([*VEHICLES, "bare"], ["Heavy", "yaw only", "surge without drag", "bare"]))
def test_every_kind_of_vehicle_moves_or_is_refused_in_one_line(name: str) -> None:
    bare = rov_fmu.load(BARE)
    vehicle = bare.with_(VEHICLES[name].layout, **VEHICLES[name].coefficients) if name != "bare" else bare
    if "m_rov" not in vehicle.coefficients:
        with pytest.raises(InputError, match=r"^bare: has no surge.*a body in MuJoCo must have$"):
            mujoco_texts(vehicle, "rov", {}, {})
        return
    rov = package_of(vehicle).load()
    for command, value in vehicle.layout.example(vehicle.layout.axes[0].axis).items():
        rov.data.actuator(command).ctrl = value
    for _ in range(20):
        rov.step()
    assert np.abs(rov.data.qvel).max() > 1e-4


def test_a_point_is_a_site_in_place_of_the_inputs_for_its_force() -> None:
    """The frames are those of MuJoCo: forward, port, up."""
    vehicle = rov_fmu.load(BARE)
    vehicle = vehicle.with_(tied(vehicle, hook=(0.3, 0.1, -0.2)).layout, r_x_hook=0.3, r_y_hook=0.1, r_z_hook=-0.2)
    rov = package_of(vehicle).load()
    assert rov.model.site("point_hook").pos == pytest.approx([0.3, -0.1, 0.2])
    assert not any("hook" in name for name in (*rov.inputs, *rov.coefficients))
    rov.step()


# ---- The folder ------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="pictures are drawn with EGL")
def test_the_folder_needs_no_rov_fmu_and_draws_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rov_fmu.bridges.mujoco.HOSTS", HOST)
    assert main(["export", "bluerov2", "--to", "mujoco", "-o", str(tmp_path / "rov")]) == 0
    program = "import runpy, sys; sys.modules['rov_fmu'] = None; sys.argv[1:] = ['rov.png']; runpy.run_module('rov')"
    python("-c", program, cwd=tmp_path, timeout=60)
    picture = (tmp_path / "rov.png").read_bytes()
    assert picture.startswith(b"\x89PNG\r\n\x1a\n")
    assert int.from_bytes(picture[16:20]) == 1280


@pytest.fixture
def viewer(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """The window of MuJoCo, on a display."""
    opened = MagicMock()
    window = SimpleNamespace(launch_passive=opened)
    monkeypatch.setitem(sys.modules, "mujoco.viewer", window)
    monkeypatch.setattr(mujoco, "viewer", window, raising=False)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    return opened


def test_where_no_window_can_open_the_reason_and_the_remedy_are_told(
    viewer: MagicMock, monkeypatch: pytest.MonkeyPatch
) -> None:
    viewer.side_effect = RuntimeError("it needs the main thread")
    rov = load_mujoco(rov_fmu.load(BARE))
    with pytest.raises(SystemExit, match=r"\(it needs the main thread\).* run mjpython"):
        show(rov)
    monkeypatch.delenv("DISPLAY")
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(SystemExit, match=r"no display .* the name of a picture"):
        show(rov)


def test_a_window_shows_steps_in_real_time_until_it_is_closed(
    viewer: MagicMock, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr("time.monotonic", lambda: clock.now)
    monkeypatch.setattr("time.sleep", lambda seconds: vars(clock).update(now=clock.now + seconds))
    viewer.return_value.is_running.side_effect = [*[True] * 4, False]
    shown = list[float]()

    def show_late() -> None:
        """The motion pauses for 10 s at the third step, and is not made up for afterwards."""
        clock.now += 10.0 * (len(shown) == 2)
        shown.append(clock.now)

    viewer.return_value.sync = show_late
    rov = load_mujoco(rov_fmu.load(BARE))
    show(rov)
    step = rov.model.opt.timestep
    assert rov.data.time == pytest.approx(4.0 * step)
    assert np.diff([*shown, clock.now]) == pytest.approx([step, 10.0 + step, 0.0, step])


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("draws") / "refit"
    options = ["--to", "mujoco", "-o", str(folder), "--draws", "4", "--seed", "1"]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.bridges.mujoco.HOSTS", HOST)
        assert main(["export", "videoray_refit", *options]) == 0
    return folder


def test_draws_are_those_of_the_environment_with_the_same_seed(drawn: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(drawn.parent)
    package = importlib.import_module("refit")
    sets = package.draws()
    environment = RovVectorEnv(rov_fmu.load("videoray_refit"), 4)
    environment.reset(seed=1)
    assert len(sets) == 4
    assert {name: [one[name] for one in sets] for name in sets[0]} == {
        name: column[:, 0].tolist() for name, column in environment.coefficients.items()
    }
    rov = package.load(**sets[2])
    assert rov.coefficients["a_d_u"] == sets[2]["a_d_u"]
    assert "100" not in (drawn / "README.md").read_text(encoding="utf-8").partition("sets of")[0][-5:]
    assert "surge: usable." in (drawn / "README.md").read_text(encoding="utf-8")
