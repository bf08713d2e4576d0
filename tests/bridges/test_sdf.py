"""The model for Gazebo: valid SDFormat, and in the plugins' equations, written out here, it moves as the FMU does.

The rules of the format are those of SDFormat 1.10 (sdf/1.10 of gazebosim/sdformat), of the elements that are written.
The equations are those of gz-sim (src/systems: hydrodynamics, buoyancy, thruster) and, for a body with added mass,
Kirchhoff's, which gz-physics solves with DART. All are in Gazebo's frames: forward-left-up and east-north-up.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import exp, pi
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from lxml import etree
from scipy.integrate import solve_ivp

from rov_fmu.bridges.sdf import gazebo_model
from rov_fmu.cli import main
from rov_fmu.equation.alone import RISE
from rov_fmu.equation.catalogue import cross_of
from rov_fmu.io.messages import InputError
from rov_fmu.io.output import sealed
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface
from tests.commands import BARE, ROOT, Capsys
from tests.often import spread
from tests.vehicles import VEHICLES, extended, pulsed
from verification.references.rigid_body import coriolis, quaternion_of, rigid_body_mass, rotation, skew

REMUS = ROOT / "examples" / "remus100" / "remus100.toml"
EVERYTHING = ROOT / "tests" / "vehicle" / "everything.toml"
FILES = {**SHIPPED, "remus100": REMUS, "everything": EVERYTHING, "bare": BARE}
LOADED = {name: load_vehicle(path) for name, path in FILES.items()}
FORMS = [{"in_world": in_world, "explicit": explicit} for in_world in (False, True) for explicit in (False, True)]


def root_of(text: str) -> Any:
    return etree.fromstring(text.encode(), etree.XMLParser(resolve_entities=False))


# ---- The specification -----------------------------------------------------------------------------------------------

SCHEMA = etree.RelaxNG(etree.parse(Path(__file__).with_name("sdformat.rng")))
_SNAME = r"[xyzkmn](?:Dot[UVWPQR]|[UVWPQR](?:(?:abs)?[UVWPQR])?)"
_PARAMETERS = {
    "Hydrodynamics": rf"link_name|disable_coriolis|{_SNAME}",
    "Thruster": "namespace|joint_name|propeller_diameter|thrust_coefficient|fluid_density|velocity_control"
    "|max_thrust_cmd|min_thrust_cmd",
    "Buoyancy": "uniform_fluid_density",
    "Physics": "",
    "UserCommands": "",
    "SceneBroadcaster": "",
}
"""What each plugin reads."""


def check(root: Any) -> None:
    """Check a file against the specification, and against what the plugins read."""
    assert SCHEMA.validate(root), SCHEMA.error_log
    for plugin in root.iter("plugin"):
        name = plugin.get("name").removeprefix("gz::sim::systems::")
        words = re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower()
        assert plugin.get("filename") == f"gz-sim-{words}-system"
        names = [child.tag for child in plugin]
        assert len(names) == len(set(names))
        assert all(re.fullmatch(_PARAMETERS[name], one) for one in names)


def check_model(root: Any) -> None:
    """Check a file, and what libsdformat refuses although each element is allowed: names, inertia, axes."""
    check(root)
    (model,) = root.iter("model")
    names = [one.get("name") for one in model.iterchildren("link", "joint")]
    assert len(names) == len(set(names))
    assert not [name for name in names if "::" in name or re.fullmatch("__.*__|world", name)]
    links = {link.get("name") for link in model.iterchildren("link")}
    for joint in model.iterchildren("joint"):
        assert {joint.findtext("parent"), joint.findtext("child")} <= links
        assert np.linalg.norm(numbers(joint.findtext("axis/xyz"))) == pytest.approx(1.0)
    for inertial in model.iter("inertial"):
        assert float(inertial.findtext("mass")) > 0.0
        least, middle, most = np.linalg.eigvalsh(inertia_of(inertial))
        assert least > 0.0
        assert least + middle >= most * (1.0 - 1e-9)


def numbers(text: str) -> Array:
    return np.array(text.split(), dtype=float)


def inertia_of(inertial: Any) -> Array:
    xx, xy, xz, yy, yz, zz = (float(inertial.findtext(f"inertia/i{ij}")) for ij in ("xx", "xy", "xz", "yy", "yz", "zz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("name", FILES)
def test_the_file_is_valid(name: str, form: Mapping[str, Any]) -> None:
    text = gazebo_model(LOADED[name], **form).text
    root = root_of(text)
    assert root.get("version") == "1.10"
    assert numbers(root.findtext(".//model/pose")) == pytest.approx([0, 0, 0, 0, 0, pi / 2]), "it heads north"
    assert not re.search(r"[> ]-0[ <]", text)
    check_model(root)


@pytest.mark.parametrize("name", VEHICLES)
def test_every_kind_of_vehicle_gives_a_valid_file_or_one_line(name: str) -> None:
    vehicle = replace(LOADED["bare"], layout=VEHICLES[name].layout, coefficients=VEHICLES[name].coefficients)
    if "m_rov" not in vehicle.coefficients:
        with pytest.raises(InputError, match="no mass m_rov"):
            gazebo_model(vehicle)
        return
    text = gazebo_model(vehicle, in_world=True).text
    check_model(root_of(text))
    if "heave" not in vehicle.layout.by_name:
        gazebo = Gazebo(text)
        assert 1000.0 * gazebo.volume == pytest.approx(vehicle["m_rov"]), "it stays in its depth"


# ---- The plugins' equations ------------------------------------------------------------------------------------------


class Gazebo:
    """A model as Gazebo moves it: a rigid body of all links under the plugins' forces, in its own frames."""

    def __init__(self, text: str) -> None:
        root = root_of(text)
        (model,) = root.iter("model")
        self.gravity = numbers(root.findtext("world/gravity"))
        self.density = float(root.findtext(".//uniform_fluid_density"))
        self.rigid, self.added, self.weights = np.zeros((6, 6)), np.zeros((6, 6)), []
        for link in model.iterchildren("link"):
            inertial, at = link.find("inertial"), numbers(link.findtext("pose") or "0 0 0 0 0 0")
            mass = float(inertial.findtext("mass"))
            centre = at[:3] + numbers(inertial.findtext("pose") or "0 0 0 0 0 0")[:3]
            about = inertia_of(inertial) - mass * skew(centre) @ skew(centre)
            self.rigid += rigid_body_mass(mass, about, centre)
            self.weights.append((mass, centre))
            for entry in inertial.iterfind("fluid_added_mass/*"):
                i, j = map("xyzpqr".index, entry.tag)
                self.added[i, j] = self.added[j, i] = float(entry.text)
        box = model.find("link/collision")
        self.volume = float(np.prod(numbers(box.findtext("geometry/box/size"))))
        self.centre = numbers(box.findtext("pose"))[:3]
        plugins = {p.get("name").rpartition(":")[2]: p for p in model.iterchildren("plugin")}
        terms = {one.tag: float(one.text) for one in plugins["Hydrodynamics"] if re.fullmatch(_SNAME, one.tag)}
        U = "UVWPQR"
        self.linear = np.array([[terms.get(f"{a}{b}", 0.0) for b in U] for a in "xyzkmn"])
        self.squares = np.array([[[terms.get(f"{a}{b}{c}", 0.0) for c in U] for b in U] for a in "xyzkmn"])
        self.sizes = np.array([[[terms.get(f"{a}{b}abs{c}", 0.0) for c in U] for b in U] for a in "xyzkmn"])
        self.explicit = np.array([[terms.get(f"{a}Dot{b}", 0.0) for b in U] for a in "xyzkmn"])
        self.thrusters, self.places, self.largest, self.least = {}, {}, {}, {}
        for plugin in (p for p in model.iterchildren("plugin") if p.get("name").endswith("Thruster")):
            name = plugin.findtext("joint_name").removeprefix("thruster_").removesuffix("_joint")
            joint = next(j for j in model.iterchildren("joint") if j.get("name") == plugin.findtext("joint_name"))
            link = next(k for k in model.iterchildren("link") if k.get("name") == joint.findtext("child"))
            direction = numbers(joint.findtext("axis/xyz"))
            self.places[name] = numbers(link.findtext("pose"))[:3]
            self.thrusters[name] = np.concatenate([direction, np.cross(self.places[name], direction)])
            self.largest[name] = float(plugin.findtext("max_thrust_cmd"))
            self.least[name] = float(plugin.findtext("min_thrust_cmd"))

    def thrust(self, newtons: Mapping[str, float]) -> Array:
        """The force and moment of the thrusters."""
        return sum((newtons[name] * effect for name, effect in self.thrusters.items()), np.zeros(6))

    def wrench(self, turned: Array, velocity: Array) -> Array:
        """Weight, buoyancy and damping in the body frame, which `turned` turns into the world's."""
        total: Array = (self.linear + self.sizes @ np.abs(velocity) + self.squares @ velocity) @ velocity
        down = turned.T @ self.gravity
        for mass, centre in [*self.weights, (-self.density * self.volume, self.centre)]:
            total += mass * np.concatenate([down, np.cross(centre, down)])
        return total

    def rates(self, state: Array, newtons: Mapping[str, float]) -> Array:
        """The derivatives of position, rotation matrix and velocities: Kirchhoff's equations."""
        turned, velocity = state[3:12].reshape(3, 3), state[12:]
        matrix = self.rigid + self.added
        load = self.wrench(turned, velocity) + self.thrust(newtons) - coriolis(matrix, velocity)
        turning = (turned @ skew(velocity[3:])).ravel()
        return np.concatenate([turned @ velocity[:3], turning, np.linalg.solve(matrix, load)])

    def alone(self, axis: int, newtons: Mapping[str, float]) -> Callable[[float, Array], list[float]]:
        """The acceleration along one axis of a level vehicle that the others do not move."""
        push, inertia = self.thrust(newtons)[axis], (self.rigid + self.added)[axis, axis]
        return lambda _, v: [(self.wrench(np.eye(3), v[0] * np.eye(6)[axis])[axis] + push) / inertia]


SIGNS = {"u": 1.0, "v": -1.0, "w": -1.0, "p": 1.0, "q": -1.0, "r": -1.0}
"""The signs of components in Gazebo's frame by those in the vehicle's: left for starboard, up for down."""


def newtons_of(gazebo: Gazebo, rov: Vehicle, thrust: Mapping[str, float]) -> dict[str, float]:
    """The newtons to send for the thrust of the FMU; alpha is seen in the largest thrust."""
    full = {name: rov[f"health_{name}"] * rov.curve_force(curve, 1.0) for name, curve in rov.layout.curve_of.items()}
    return {name: force * gazebo.largest[name] / full[name] for name, force in thrust.items()}


@pytest.mark.parametrize("command", [0.3, *(pytest.param(c, marks=pytest.mark.long) for c in (-0.6, 0.1, 1.0))])
@pytest.mark.parametrize("name", SHIPPED)
def test_an_axis_alone_has_the_steady_velocity_and_the_time_constant_of_the_fmu(name: str, command: float) -> None:
    rov = LOADED[name]
    gazebo = Gazebo(gazebo_model(rov, in_world=True).text)
    for form in rov.layout.axes:
        if not rov.layout.thrusters_along(form.axis):
            continue
        V_ss, Tau = rov.response(form.axis, command)
        newtons = newtons_of(gazebo, rov, rov.commanded(rov.held_inputs(form.axis, command)))
        velocity, sign = form.axis.velocity, SIGNS[form.axis.velocity]
        reached = lambda _, v: v[0] - sign * RISE * V_ss  # noqa: B023, E731
        found = solve_ivp(
            gazebo.alone("uvwpqr".index(velocity), newtons),
            (0.0, 50.0 * Tau),
            [0.0],
            "DOP853",
            events=reached,
            rtol=1e-7,
            atol=1e-10,
        )
        assert sign * found.y[0, -1] == pytest.approx(V_ss, rel=2e-4), velocity
        assert found.t_events[0][0] == pytest.approx(Tau, rel=2e-4), velocity


EARTH = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From north-east-down to east-north-up."""
HALF_TURN = np.diag([1.0, -1.0, -1.0])
"""From forward-starboard-down to forward-left-up."""


def turned_in_gazebo(phi: float, theta: float, psi: float) -> Array:
    """The axes of the vehicle (forward, to port, up) in east, north and up, by the Euler angles of the FMU."""
    turned: Array = rotation(quaternion_of(phi, theta, psi)).astype(float)
    return EARTH @ turned @ HALF_TURN


@pytest.mark.parametrize("name", LOADED)
def test_the_thrust_of_each_propeller_is_listed_and_what_the_vehicle_lacks_is_held(name: str) -> None:
    rov = LOADED[name]
    text = gazebo_model(rov, in_world=True).text
    gazebo = Gazebo(text)
    assert gazebo.rigid[0, 0] == pytest.approx(rov["m_rov"], rel=1e-9)
    own = [gazebo.rigid[n, n] for n, v in enumerate("uvwpqr") if n > 2 and v in rov.layout.by_velocity]
    for n, v in enumerate("uvwpqr"):
        if v not in rov.layout.by_velocity:
            assert 0.0 < -gazebo.rigid[n, n] / gazebo.linear[n, n] < 0.1, "s until it rests"
            typical = max(own, default=rov["m_rov"] * gazebo.volume ** (2.0 / 3.0) / 6.0)
            assert n < 3 or gazebo.rigid[n, n] == pytest.approx(1000.0 * typical, rel=5e-4)
            assert n < 3 or not any(abs(wrench[n]) > 1e-9 for wrench in gazebo.thrusters.values())
    if name == "bluerov2_heavy":
        for t in rov.layout.thrusters:
            assert gazebo.places[t.name] == pytest.approx(HALF_TURN @ t.place)
    titles = re.findall(r"<!-- (.*)\n +command", text)
    assert titles[0] == {"videoray": "left thruster", "bare": "thruster t"}.get(name, titles[0])
    rows = [numbers(row) for row in re.findall(r" (?:command|newtons) +([-\d].*\d)", text)]
    for commands, forces, (thruster, largest) in zip(rows[::2], rows[1::2], gazebo.largest.items(), strict=True):
        assert commands.tolist() == [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0]
        curve = [rov.curve_force(rov.layout.curve_of[thruster], command) for command in commands]
        assert forces == pytest.approx(np.multiply(curve, largest / curve[-1]), rel=1e-3)
        assert gazebo.least[thruster] == pytest.approx(largest * curve[0] / curve[-1])


def in_gazebo(rov: Vehicle, state: dict[str, float]) -> Array:
    """Position, rotation matrix and velocities of a state of the FMU, in Gazebo's frames."""
    angles = state | rov.calculated(rov.layout.usual_inputs, state)
    turned = turned_in_gazebo(*(angles.get(name, 0.0) for name in ("phi", "theta", "psi")))
    velocity = [sign * state.get(name, 0.0) for name, sign in SIGNS.items()]
    return np.concatenate([EARTH @ [state[name] for name in "xyz"], turned.ravel(), velocity])


def fly(vehicle: Vehicle, state: dict[str, float], pieces: int, seed: int) -> tuple[Array, Array]:
    """The last states of the FMU and of Gazebo under random commands, held for 0.4 s each; Gazebo gets the lag, too."""
    rov, random = vehicle, Random(seed)
    gazebo = Gazebo(gazebo_model(vehicle, in_world=True).text)
    mine = in_gazebo(rov, state)
    for _ in range(pieces):
        inputs = rov.layout.usual_inputs | {name: random.uniform(-0.6, 0.6) for name in rov.layout.commands}
        inputs |= {f"u_{fin.name}": 0.0 for fin in rov.layout.fins}
        steady, before = rov.commanded(inputs), dict(state)

        def rates(t: float, y: Array, steady: Any = steady, before: Any = before) -> Array:
            thrust = {}
            for name, force in steady.items():
                curve = rov.layout.curve_of[name]
                left = exp(-t / rov[curve.coefficient("T")]) if curve.has_lag else 0.0
                thrust[name] = force + left * (before.get(f"F_{name}", force) - force)
            return gazebo.rates(y, newtons_of(gazebo, rov, thrust))

        mine = solve_ivp(rates, (0.0, 0.4), mine, "DOP853", rtol=1e-7, atol=1e-9).y[:, -1]
        state = rov.step(inputs, state, 0.4)
    return in_gazebo(rov, state), mine


def tuned(name: str, **coefficients: float) -> Vehicle:
    vehicle = LOADED[name]
    return extended(vehicle, **coefficients)


def with_cross(vehicle: Vehicle, **coefficients: float) -> Vehicle:
    """Return a vehicle with more coefficients between two axes."""
    cross = (*vehicle.layout.cross, *filter(None, map(cross_of, coefficients)))
    layout = replace(vehicle.layout, cross=cross)
    return replace(vehicle, layout=layout, coefficients={**vehicle.coefficients, **coefficients})


MOVING: dict[str, tuple[Vehicle, dict[str, float]]] = {
    "four axes": (tuned("bluerov2", alpha_u=1.1, alpha_v=0.9, alpha_w=1.05, alpha_r=1.2, beta_v=0.8), {}),
    "six axes": (tuned("bluerov2_heavy", beta_u=0.7, beta_q=0.8, beta_r=1.3), {}),
    "moments that no body has": (tuned("bluerov2_heavy", I_r=0.8), {}),
    "drag by direction and cross terms": (
        with_cross(tuned("remus100", a_d_u_reverse=9.0, a_d_v_reverse=700.0, a_d_p_reverse=0.5), b_d_pv=0.3),
        {"u": 1.2, "v": 0.2, "w": -0.1, "p": 0.3, "q": 0.1, "r": -0.2},
    ),
}
"""Vehicles, and the velocities with which they start."""


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if "cross" in case else pytest.mark.long) for case in MOVING]
)
def test_gazebo_moves_as_the_fmu(case: str) -> None:
    rov, velocities = MOVING[case]
    vehicle = without_surface(rov)  # Gazebo's plugins know none
    true, found = fly(vehicle, vehicle.layout.at_rest | velocities, 6, seed=5)
    assert np.max(np.abs(true[:3])) > 0.2, "it went somewhere"
    assert found == pytest.approx(true, abs=4e-4)


# ---- The plugin's explicit added mass --------------------------------------------------------------------------------


def grows(vehicle: Vehicle, *, explicit: bool) -> bool:
    """True if velocities grow without bound in steps of 1 ms: the plugin's force follows the last acceleration."""
    gazebo = Gazebo(gazebo_model(vehicle, in_world=True, explicit=explicit).text)
    newtons = {name: 0.1 * n * force for n, (name, force) in enumerate(gazebo.largest.items())}
    thrust, accelerated = gazebo.thrust(newtons), np.linalg.inv(gazebo.rigid + gazebo.added)
    velocity: Array = np.zeros(6)
    acceleration: Array = np.zeros(6)
    for _ in range(1000):
        acceleration = accelerated @ (gazebo.wrench(np.eye(3), velocity) + thrust + gazebo.explicit @ acceleration)
        velocity = velocity + 1e-3 * acceleration
        if np.max(np.abs(velocity)) > 1e3:
            return True
    return False


EXPLICIT = {
    "videoray": (LOADED["videoray"], "yaw (0.77 of 0.105 kg.m2)"),
    "bluerov2": (LOADED["bluerov2"], "sway (12.7 of 11.5 kg), heave (14.57 of 11.5 kg)"),
    "remus100": (
        LOADED["remus100"],
        "sway (35.5 of 30.48 kg), heave (35.5 of 30.48 kg), pitch (4.88 of 3.45 kg.m2), yaw (4.88 of 3.45 kg.m2)",
    ),
    "just less": (LOADED["bluerov2"].with_(m_a_v=11.2, m_a_w=11.2), None),
    "just more": (LOADED["bluerov2"].with_(m_a_v=11.2, m_a_w=11.8), "heave (11.8 of 11.5 kg)"),
    "a large beta": (LOADED["videoray"].with_(beta_r=0.55), None),
}


@pytest.mark.parametrize("case", spread(EXPLICIT, ("just less", "just more"), EXPLICIT))
def test_the_warning_is_there_where_the_plugin_diverges(case: str) -> None:
    vehicle, where = EXPLICIT[case]
    warnings = gazebo_model(vehicle, explicit=True).warnings
    assert grows(vehicle, explicit=True) == bool(warnings) == bool(where)
    assert gazebo_model(vehicle).warnings == (), "in the link it is implicit"
    assert not grows(vehicle, explicit=False)
    if where:
        assert f" not less than the link's own: {where} (gz-sim issue 1923); use --added-mass link" in warnings[0]


# ---- Notes and mistakes ----------------------------------------------------------------------------------------------

PARALLEL = tuned("bluerov2_heavy", I_r=0.8, F_0_w=2.0, alpha_u=0.8, alpha_v=0.6, alpha_w=0.0)
IN_GAZEBO = {
    "tuning": (LOADED["videoray"], False),
    "directions": (LOADED["everything"], True),
    "moments": (pulsed(PARALLEL, (1100.0, 1500.0, 1900.0)), False),
    "fins": (LOADED["remus100"], False),
}
"""Vehicles, and whether the added mass is in the plugin. The whole files, with their notes, are in tests/frozen."""


@pytest.mark.parametrize("case", IN_GAZEBO)
def test_the_notes_say_in_the_file_too_what_is_otherwise(case: str) -> None:
    vehicle, explicit = IN_GAZEBO[case]
    model = gazebo_model(vehicle, explicit=explicit)
    check_model(root_of(model.text))
    (comment, *_) = root_of(model.text).xpath("/comment()")
    assert model.notes
    assert all(f"- {note}.\n" in comment.text for note in model.notes)


def renamed(vehicle: Vehicle, old: str, new: str) -> Vehicle:
    """Return a vehicle with another name of a thruster."""
    thrusters = (replace(t, name=new) if t.name == old else t for t in vehicle.layout.thrusters)
    return replace(vehicle, layout=replace(vehicle.layout, thrusters=tuple(thrusters)))


@pytest.mark.parametrize(
    ("vehicle", "line"),
    [
        (tuned("videoray", beta_u=0.0), "videoray: beta_u = 0: must be more than 0 for Gazebo, because m/beta_u is a"),
        (
            tuned("bluerov2", F_0_w=150.0),
            "bluerov2: the net weight of 150 N must be less than the weight for Gazebo, because the Buoyancy plugin "
            "only pushes upwards: 112.7 N",
        ),
        (
            renamed(LOADED["bluerov2"], "2", "1_joint"),
            "bluerov2: thruster.1_joint: choose another name for Gazebo, where the joint of 1 has this name",
        ),
    ],
)
def test_what_gazebo_cannot_have_is_one_line(vehicle: Vehicle, line: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(line)}[^\n]*$"):
        gazebo_model(vehicle)


def test_the_command_writes_the_file_and_lists_the_notes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    model, explicit = gazebo_model(LOADED["bluerov2"]), gazebo_model(LOADED["bluerov2"], in_world=True, explicit=True)
    notes = "".join(f"- {note}\n" for note in model.notes)
    for options, file, wanted, words in (
        ([], "bluerov2.sdf", model, f"What is different in Gazebo:\n{notes}Wrote bluerov2.sdf. Next: include it in a "),
        (["--world", "--added-mass", "plugin", "-o", "my rov.sdf"], "my rov.sdf", explicit, "gz sim -r 'my rov.sdf'\n"),
    ):
        assert main(["export", "bluerov2", "--to", "sdf", *options]) == 0
        assert Path(file).read_bytes() == sealed(wanted.text, "export").encode()
        out, err = capsys.readouterr()
        assert words in out
        assert err == "".join(f"rov-fmu: warning: {warning}\n" for warning in wanted.warnings)
