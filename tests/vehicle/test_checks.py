"""Contradictions in vehicle files: each gives a line with the key, the value and what is allowed."""

import re
from math import isclose, nextafter, sqrt
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.schema import Direction, Position
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.damage import toml_of
from tests.vehicle.test_vehicle import refusal
from tests.vehicles import EVERYTHING, SIX_AXES

TEXT, SIX = (path.read_text(encoding="utf-8") for path in (EVERYTHING, SIX_AXES))


@pytest.fixture(scope="module")
def everything() -> Vehicle:
    return load_vehicle(EVERYTHING)


# ---- A vehicle with every key ----------------------------------------------------------------------------------------


def test_a_direction_has_a_length_and_a_position_is_near() -> None:
    for length in (1e-6, 0.5, 1.0, 1e6):
        assert Direction(value=(0.0, 0.6 * length, -0.8 * length), source="S").value == pytest.approx((0.0, 0.6, -0.8))
    for length in (0.9e-6, 1.1e6):
        with pytest.raises(ValueError, match="must have a length, from 1e-6 to 1e6"):
            Direction(value=(0.0, 0.6 * length, -0.8 * length), source="S")
    assert Position(value=(100.0, -100.0, 0.0), unit="m", source="S").value == (100.0, -100.0, 0.0)
    with pytest.raises(ValueError, match=r"must be within -100 ... 100 m"):
        Position(value=(0.0, 0.0, nextafter(-100.0, -101.0)), unit="m", source="S")


def test_a_direction_of_any_length_is_a_unit_vector(everything: Vehicle) -> None:
    first, left = everything.layout.thrusters[0], everything.layout.thrusters[-2]
    assert all(
        isclose(part, exact) for part, exact in zip(first.direction.value, (sqrt(0.5), -sqrt(0.5), 0.0), strict=True)
    )
    assert left.direction.value == (1.0, 0.0, 0.0)
    assert (left.arm, left.position) == ("port", None)


# ---- Mistakes --------------------------------------------------------------------------------------------------------


GONE = object()
"""This value removes a key."""


def changed(changes: dict[str, Any], text: str = TEXT) -> str:
    """Return a file with other values of some keys. A thruster is found by its name."""
    data = toml_of(text)
    for place, value in changes.items():
        *above, key = place.split(".")
        table = data
        for step in above:
            table = table[step] if isinstance(table, dict) else next(t for t in table if t.get("name") == step)
        if isinstance(table, list):
            table[:] = [thruster for thruster in table if thruster["name"] != key]
        elif value is GONE:
            del table[key]
        else:
            table[key] = value
    return tomlkit.dumps(data)


def quantity(value: float, unit: str) -> dict[str, Any]:
    """Return a value with its unit and a source."""
    return {"value": value, "unit": unit, "source": "x"}


def place(*value: float) -> dict[str, Any]:
    """Return the position of a thruster."""
    return {"value": [*value], "unit": "m", "source": "x"}


_N = quantity(1.0, "N")
_CURVE = {"a_t": _N, "b_t": _N}
_ALONE: dict[str, Any] = {"inputs": GONE, "alternatives": GONE, "body.coupling": GONE}
"""Changes that remove the keys which refer to other parts of the vehicle by name."""
_NO_BOOST: dict[str, Any] = {**_ALONE, "thruster.l": GONE, "thruster.r": GONE, "curves.boost": GONE, "arm": GONE}


# How the file is changed, and the parts of each line, in their order.
def _point(name: str, x: float = -0.2) -> dict[str, Any]:
    """Return a point of a vehicle file."""
    return {"name": name, "position": place(x, 0.0, -0.1)}


MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    # names
    "a name twice": ({**_ALONE, "thruster.2.name": "1"}, "thruster#2.name = '1': thruster#1 has this name"),
    "names of thrusters that differ in case": (
        {**_ALONE, "thruster.l.name": "R"},
        "thruster#7.name = 'r': thruster#6 has the name 'R': they differ only in case",
    ),
    "a curve without a name and one with an endless one": (
        {**_ALONE, "curves": {"": _CURVE, "x" * 300: _CURVE}},
        f"curves.'' = '' … letters\ncurves.{'x' * 70}... = 'xxx … letters\n"
        + "\n".join(f"thruster.{n}.curve … there is no such curve, only '', {'x' * 193}..." for n in "12345lr"),
    ),
    "a curve of no thruster": ({"curves.spare": _CURVE}, "curves.spare: no thruster has this curve"),
    "a point with a name of the centre of buoyancy": (
        {"point": [_point("B")]},
        "point.B: has the name x_B in the FMU, which body.x_B has too: rename one of them",
    ),
    "a point with a name of the centre of mass": (
        {"point": [_point("hook"), _point("G")]},
        "point.G: has the name x_G in the FMU, which body.x_G has too: rename one of them",
    ),
    "a thruster and a point of one name": (
        {**_ALONE, "thruster.2.name": "N_hook", "point": [_point("hook")]},
        "point.hook: has the name F_N_hook in the FMU, which thruster.N_hook has too: rename one of them",
    ),
    "two points whose names differ in case": (
        {"point": [_point("hook"), _point("Hook")]},
        "point#2.name = 'Hook': point#1 has the name 'hook': they differ only in case",
    ),
    "two coefficients of one name": (
        {
            **{"curves.boost": GONE, "curves.frame_reverse": _CURVE},
            **{f"thruster.{name}.curve": "frame_reverse" for name in "lr"},
        },
        "curves.frame_reverse.a_t: has the name a_t_frame_reverse in the FMU, which curves.frame.a_t_reverse has",
    ),
    "a lag with the name of the dead time": (
        {
            **{"commands": {"T_d": quantity(0.1, "s")}, "curves.boost": GONE},
            **{"curves.d": {**_CURVE, "T": quantity(0.1, "s")}, "thruster.l.curve": "d", "thruster.r.curve": "d"},
        },
        "curves.d.T: has the name T_d in the FMU, which commands.T_d has too: rename one of them",
    ),
    "a thrust with the name of a load": (
        {**_ALONE, "thruster.1.name": "0_w"},
        "axes.heave.F_0: has the name F_0_w in the FMU, which thruster.0_w has too: rename one of them",
    ),
    **{
        f"identifier {name}, which Windows reserves": (
            {"vehicle.identifier": name},
            f"vehicle.identifier = '{name}': must not be a name that Windows reserves: CON, PRN, AUX, NUL, COM0",
        )
        for name in ("CON", "Prn", "com1")
    },
    **{
        f"identifier {name}, a keyword": (
            {"vehicle.identifier": name},
            f"vehicle.identifier = '{name}': must be a C identifier, and not a keyword of C",
        )
        for name in ("int", "_Bool", "nullptr")
    },
    # forms of keys and values
    "an unknown coefficient": (
        {"arm.mass": quantity(6.57, "kg")},
        "arm.mass: there is no such key, only R, gamma",
    ),
    "a number without unit and source": (
        {"arm.R": 0.22},
        'arm.R = 0.22: must be { value = ..., unit = "m", source = ... }',
    ),
    "an angle in degrees": ({"arm.gamma.value": 24.2}, "arm.gamma.value = 24.2 … 1.57"),
    "an interval without ends": ({"body.m_rov.interval": []}, "body.m_rov.interval = []: must have 2 entries"),
    "a missing folder": ({"vehicle.data": "nowhere"}, "vehicle.data = 'nowhere' … no such folder"),
    "a number in a list of texts": (
        {"validity.limits": [3, "It does not roll."]},
        "validity.limits = [3,  … entry 1 must be text in quotes",
    ),
    "no format": ({"format": GONE}, "format: this key is missing: write format = 2"),
    "no range of commands": (
        {"validity.command_max": 0.1},
        "validity.command_min = 0.1: must be less than command_max = 0.1",
    ),
    # keys that need others, or have no use
    "a dead band in reverse only": ({"curves.frame.c_0": GONE}, "curves.frame.c_0 … missing … c_0_reverse"),
    "no mass": ({"body.m_rov": GONE}, "body.m_rov … missing … surge"),
    "no arm": ({"arm": GONE}, "arm … R and gamma … missing … a thruster has the key arm"),
    "an arm for nothing": (
        {f"thruster.{n}.{key}": v for n in "lr" for key, v in (("arm", GONE), ("position", place(0.0, 0.1, 0.0)))},
        "arm.R: only yaw with thrusters that have the key arm needs it: remove it\n"
        "arm.gamma: only yaw with thrusters that have the key arm needs it: remove it",
    ),
    "an arm of a thruster astern": (
        {"thruster.l.direction.value": [-1.0, 0.0, 0.0]},
        "thruster.l.arm … pushes ahead … position instead",
    ),
    "an arm of no length": (
        {"arm.R.value": 0.0, "arm.gamma.value": 0.0},
        "arm.R.value = 0.0: must be more than 0 … the arm R sin γ is 0\narm.gamma.value = 0.0: must be more than 0",
    ),
    "no place": ({"thruster.1.position": GONE}, "thruster.1.position … or arm … missing … yaw"),
    # numbers
    "an interval below its value": (
        {"body.m_rov.interval": [13.0, 13.4]},
        "body.m_rov.interval = [13.0, 13.4]: must be [low, high] around the value 13.5",
    ),
    "a direction of no length": (
        {"thruster.5.direction.value": [0, 0, 0]},
        "thruster.5.direction.value = [0, 0, 0] … must have a length",
    ),
    # thrust
    "thrust of the wrong sign": (
        {"curves.boost.a_t.value": -200.0, "curves.boost.b_t.value": 10.0},
        "curves.boost: must give a force above 0 at full command, but a_t_boost and b_t_boost give -190 N",
    ),
    "thrust in reverse of the wrong sign": (
        {"curves.frame.a_t_reverse.value": -100.0},
        "curves.frame: must give a force above 0 at full command in reverse … b_t_frame_reverse give -60.0389 N",
    ),
    "no thrust at full command": ({"curves.boost.a_t.value": -5.0}, "curves.boost: must … b_t_boost give 0 N"),
    # geometry
    "no axes": ({**_NO_BOOST, "axes": {}}, "axes … at least one of surge, sway, heave, roll, pitch, yaw"),
    "an axis that no thruster drives": (
        {**_ALONE, "thruster.5.direction.value": [1, 0, 0], "thruster.5.position": place(0.0, 0.0, 0.0)},
        "axes.heave: no thruster drives it: give one a direction with a part down, or remove this table",
    ),
    "a thruster that drives no axis": (
        {**_ALONE, "axes.heave": GONE},
        "thruster.5 … acts on no axis of the vehicle, which are surge, sway, yaw",
    ),
    "a yaw without an arm": (
        {**_NO_BOOST, **{f"thruster.{n}.position.value": [0, 0, 0] for n in "1234"}},
        "axes.yaw: no thruster turns the vehicle: give one a position beside the line of its force … remove",
    ),
    "thrusters that cancel": (
        {
            **_NO_BOOST,
            **{f"thruster.{n}.position.value": [x, 0.0, 0.0] for n, x in (("1", 1), ("2", 1), ("3", 1), ("4", 1))},
        },
        "axes.sway: the thrusters cancel: they drive it only together with yaw; correct a direction or a position",
    ),
    # coupling
    "coupling of an endless inertia": ({"axes.yaw.beta.value": 0.0}, "axes.yaw.beta.value = 0.0 … at least 0.001"),
    # inputs
    "an input for a thruster that is not there": (
        {"inputs.heave.6": 1.0},
        "inputs.heave.6 … no such thruster, only 1, 2, 3, 4, 5, l, r",
    ),
    "a thruster no input drives": ({"inputs.boost.r": 0.0}, "inputs … no input drives the thruster r"),
    "an input that drives nothing": (
        {"inputs.idle": {"5": 0.0}},
        "inputs.idle: drives no thruster: give one a gain other than 0",
    ),
    "an axis no input drives": ({"inputs.yaw": GONE, "inputs.boost.r": 1.0}, "axes.yaw … no input drives it"),
    # alternatives
    "alternatives that are unknown, have a wrong unit, and are out of bounds": (
        {"alternatives.other": {"description": "x", "a_du": _N, "m_rov": _N, "a_d_u": quantity(-1.0, "N.s2/m2")}},
        "alternatives.other.a_du: there is no such coefficient of this vehicle; did you mean a_d_u?\n"
        "alternatives.other.m_rov.unit = 'N': must be 'kg'; convert the value\n"
        "alternatives.other.a_d_u.value = -1.0: must be within 0 ... 1000000 N.s2/m2",
    ),
    # other tables
    "a thrust curve that is half reversed": (
        {"curves.frame.b_t_reverse": GONE},
        "curves.frame.b_t_reverse: this key is missing, and a_t_reverse is there",
    ),
    "no hash": ({"provenance.inputs": {"rov.toml": "abc"}}, "provenance.inputs.rov.toml = 'abc'"),
    "a battery that nothing needs": (
        {"battery": {"voltage": quantity(12.0, "V")}},
        "battery: no thrust depends on the voltage: give a curve V_0 and n_V, or tables; or leave it out",
    ),
    "coupling without sway": (
        {**_NO_BOOST, "body.coupling": True, "axes.sway": GONE},
        "body.coupling … needs surge, sway and yaw; there is no sway",
    ),
    "two places": (
        {"thruster.l.position": place(0.0, 0.1, 0.0)},
        "thruster.l.arm … must not be given together with position",
    ),
    "an input whose thrusters cancel": (
        {"inputs.spin": {"1": 1.0, "2": 1.0, "3": 1.0, "4": 1.0}},
        "inputs.spin … drives no axis … cancel",
    ),
    "a place beyond any vehicle": (
        {"thruster.1.position.value": [156, 111, 0.0]},
        "thruster.1.position.value = [156, 111, 0.0] … -100 ... 100 m",
    ),
}


MISTAKES_OF_SIX: dict[str, tuple[dict[str, Any], str]] = {
    # weight and buoyancy
    "no buoyancy": ({"body.B": GONE}, "body.B: this key is missing, and W is there"),
    "a centre of buoyancy of a vehicle that does not tilt": (
        {"body.x_B": GONE, "body.y_B": GONE, "body.z_G": GONE, "axes.roll": GONE, "axes.pitch": GONE, "cross": {}},
        "body.I_p: only roll needs it, and there is no [axes.roll]: remove it\n"
        "body.I_q: only pitch needs it\n"
        "body.z_B: acts only in roll and pitch: remove it, or add an axis",
    ),
    "a thruster without its place": ({"thruster.t.position": GONE}, "thruster.t.position … the vehicle has roll"),
    # cross terms
    "a cross term of an axis that is not there": (
        {"axes.pitch": GONE, "body.I_q": GONE, "cross.a_d_wq": GONE},
        "cross.m_a_uq: the vehicle has no pitch: remove this key, or add the axis",
    ),
    "a cross term in the other order": (
        {"cross.m_a_qu": quantity(0.1, "kg.m")},
        "cross.m_a_qu: write m_a_uq, which is the same coefficient",
    ),
    "a lift in the other order": (
        {"cross.Y_ru": quantity(0.1, "N.s2/(m.rad)")},
        "cross.Y_ru: write Y_ur, which is the same coefficient",
    ),
    "a cross term by its derivative": (
        {"cross.N_v|v|": quantity(-0.1, "N.m.s2/m2")},
        "cross.N_v|v| = 'N_v|v|': is not a coefficient of several axes; give its negative as a_d_rv in [cross]",
    ),
    "a cross term of one axis": (
        {"cross.m_a_uu": quantity(1.0, "kg")},
        "cross.m_a_uu: there is no such key, only m_a_uq, b_d_uq, a_d_uq and Y_ur … drag of one axis is in [axes]",
    ),
    # the mass matrix
    "an entry of the mass matrix that is too large": (
        {"cross.m_a_uq.value": 3.0},
        "cross.m_a_uq.value = 3.0: the entry of the mass matrix for surge and pitch … within ±3 … but it is 3.24",
    ),
    "a centre of mass too far away": (
        {"body.z_G.value": 0.3},
        "cross.m_a_uq.value = -0.1: the entry … surge and pitch, with that of the centre of mass … but it is 3.5",
    ),
    "a centre of mass too high": (
        {"cross": {}, "body.z_G.value": 0.3},
        "body.z_G.value = 0.3: the entry … for surge and pitch … within ±3 for … but it is 3.6",
    ),
    "a centre of mass too far ahead": (
        {"cross": {}, "body.x_G.value": 0.5},
        "body.x_G.value = 0.5: the entry … for sway and yaw … within ±3.633 for … but it is 6",
    ),
    "entries of the mass matrix of an endless inertia": (
        {"body.coupling": GONE, "axes.heave.beta": quantity(0.0, "1")},
        "axes.heave.beta.value = 0.0: must be at least 0.001 where axes are coupled",
    ),
    # Fossen's notation
    "a drag by its derivative": (
        {"axes.surge.X_uu": quantity(-6.36, "kg")},
        "axes.surge.X_uu: there is no such key; give -X_u|u|, which is positive, as a_d of [axes.surge]",
    ),
    "entries that are too large together": (
        {"cross.m_a_uq.value": 1.7, "cross.m_a_ur": quantity(1.7, "kg.m"), "cross.m_a_qr": quantity(-0.3, "kg.m2")},
        "cross: the mass matrix of … must be positive definite: reduce m_a_uq, m_a_pr, m_a_ur, m_a_qr",
    ),
    "a negative added mass": (
        {"axes.surge.m_a.value": -6.36},
        "axes.surge.m_a.value = -6.36: must be within 0 ... 1000000 kg; give -X_udot as a positive m_a",
    ),
    "an added mass beyond any vehicle": ({"axes.surge.m_a.value": 1e7}, "axes.surge.m_a.value … 0 ... 1000000 kg$"),
}


def check_mistakes(path: Path, wanted: str) -> None:
    """Check that a file is refused with a line for each line of `wanted`, which has parts of it in their order.

    A `$` is the end of the line.
    """
    for line, words in zip(refusal(path).splitlines(), wanted.splitlines(), strict=True):
        assert line.startswith(f"{path}: {words.split(' … ')[0]}")
        assert all(word in f"{line}$" for word in words.split(" … ")), line


CASES = [(TEXT, case) for case in MISTAKES.items()] + [(SIX, case) for case in MISTAKES_OF_SIX.items()]


@pytest.mark.parametrize(("text", "case"), CASES, ids=[name for _, (name, _) in CASES])
def test_each_mistake_is_one_clear_line(
    text: str, case: tuple[str, tuple[dict[str, Any], str]], tmp_path: Path
) -> None:
    changes, wanted = case[1]
    path = tmp_path / "rov.toml"
    path.write_text(changed(changes, text), encoding="utf-8")
    check_mistakes(path, wanted)


# ---- Valid vehicles --------------------------------------------------------------------------------------------------

VALID: dict[str, tuple[str, dict[str, Any]]] = {
    "as it is": (TEXT, {}),
    "an axis that does not accelerate by itself": (TEXT, {"axes.heave.beta": quantity(0.0, "1")}),
    "the least β of a coupled axis, and an interval of no width": (
        TEXT,
        {"axes.yaw.beta.value": 0.001, "body.m_rov.interval": [13.5, 13.5]},
    ),
    "only heave": (
        TEXT,
        {
            **_NO_BOOST,
            "axes.surge": GONE,
            "axes.sway": GONE,
            "axes.yaw": GONE,
            "body.I_r": GONE,
            **{f"thruster.{n}": GONE for n in "1234"},
        },
    ),
    "a weight without centres": (TEXT, {"body.W": quantity(132.4, "N"), "body.B": quantity(133.0, "N")}),
    "linear damping at its limit": (SIX, {"cross.b_d_vr.value": 3.3}),
}


@pytest.mark.parametrize("case", VALID)
def test_a_valid_vehicle_can_be_simulated(case: str, tmp_path: Path) -> None:
    path, (text, changes) = tmp_path / "rov.toml", VALID[case]
    path.write_text(changed(changes, text), encoding="utf-8")
    vehicle = load_vehicle(path)
    start = vehicle.layout.at_rest
    moved = vehicle.step(dict.fromkeys(vehicle.layout.inputs, 0.3), start, 0.01)
    assert moved.keys() >= start.keys()
    assert any(moved[name] != start[name] for name in vehicle.layout.velocities)


# ---- Six axes --------------------------------------------------------------------------------------------------------

DOUBTS: dict[str, tuple[dict[str, Any], str]] = {
    "a weight in kg": (
        {"body.W.value": 12.0},
        "body.W.value = 12.0: m_rov = 12 kg weighs 117.7 N: one of the two is probably wrong",
    ),
    "a buoyancy below the centre of mass": (
        {"body.z_B.value": 0.03},
        "body.z_B.value = 0.03: buoyancy acts below the centre of mass, z_G = 0.02 m, and turns the vehicle upside",
    ),
    "a buoyancy below the middle of the vehicle": (
        {"body.z_G": GONE, "body.z_B.value": 0.01},
        "body.z_B.value = 0.01: buoyancy acts below the centre of mass, z_G = 0 m, and turns the vehicle upside down",
    ),
    "linear damping that drives": (
        {"cross.b_d_vr.value": 4.0},
        "cross.b_d_vr.value = 4.0: the linear damping adds energy to some slow motions of sway and yaw: "
        "b_d_vr + b_d_rv should be within ±3",
    ),
    "linear damping that drives three axes": (
        {
            "cross": {
                "b_d_vr": quantity(2.8, "N.s/rad"),
                "b_d_pr": quantity(0.4, "N.m.s/rad"),
                "b_d_vp": quantity(-2.5, "N.s/rad"),
            }
        },
        "cross: the linear damping adds energy to some slow motions of sway, roll and yaw: reduce its b_d_..",
    ),
}


@pytest.mark.parametrize("case", DOUBTS)
def test_numbers_that_are_probably_wrong_give_a_warning(case: str, tmp_path: Path) -> None:
    changes, words = DOUBTS[case]
    path = tmp_path / "rov.toml"
    path.write_text(changed(changes, SIX), encoding="utf-8")
    with pytest.warns(UserWarning, match=re.escape(f"{path}: {words}")) as caught:
        load_vehicle(path)
    assert [one.filename for one in caught] == [__file__]


@pytest.mark.parametrize(
    ("source", "values", "message"),
    [
        (SIX_AXES, {"m_a_uq": 3.0}, "cross.m_a_uq.value = 3.0: the entry of the mass matrix"),
        (EVERYTHING, {"R": 0.0}, "R, gamma: must both be more than 0, because R sin γ is the arm of the thrusters"),
        (EVERYTHING, {"a_t_boost": -5.0}, "curve boost: must give a force above 0 at full command"),
        (EVERYTHING, {"mass": 14.0}, "mass: there is no such coefficient of this vehicle; did you mean m_rov?"),
        (EVERYTHING, {"m_rov": True}, "m_rov = True: must be a finite number"),
        (EVERYTHING, {"m_rov": float("inf")}, "m_rov = inf: must be a finite number"),
    ],
)
def test_a_coefficient_that_is_impossible_cannot_be_set(source: Path, values: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        load_vehicle(source).with_(**values)
