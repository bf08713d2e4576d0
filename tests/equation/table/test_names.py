"""The names of curves, thrusters, fins and inputs do not change the motion.

Random vehicles are renamed at random. Names from the equation itself, such as `max_rudder` and `main_1`, and words of C
and Python are the most dangerous ones.
"""

import copy
import random
import re
import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit

from rov_fmu.c.jacobian import step_jacobian
from rov_fmu.c.simulation import simulate
from rov_fmu.c.source import sources
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import equation_of
from rov_fmu.io.paths import FMU_SRC
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import EVERYTHING, SIX_AXES, THRUST_EFFECTS, random_inputs, random_state

Toml = dict[str, Any]
Names = dict[str, dict[str, str]]
"""New names by the kind of a part and its name: of curves, of inputs, and of all that is driven."""

EVIL = (
    *("u", "v", "w", "p", "q", "r", "x", "y", "z", "n", "d", "t", "at", "psi", "u_l", "alpha_u", "beta_r", "0_w"),
    *("main", "main_1", "1_main", "0_main", "F_1", "F_l", "l_reverse", "reverse", "one", "max_rudder", "v_u_r", "d_u"),
    *("thrust_main", "force", "slope", "interval", "REF_u", "N_STATES", "command_l", "table", "time", "voltage", "_"),
    *("self", "math", "exp", "sin", "abs", "pow", "where", "int", "double", "static", "lambda", "def", "OK", "1"),
)
_WORD = re.compile(r"[A-Za-z_]\w*")
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
FIXED = {
    word
    for path in FMU_SRC.rglob("*")
    if path.name.endswith((".c", ".h", ".h.j2"))
    for word in _WORD.findall(_COMMENT.sub(" ", path.read_text(encoding="utf-8")))
}
"""The words of the C sources and of the templates."""


# ---- Random vehicles and names ---------------------------------------------------------------------------------------


def _fin(name: str, direction: list[float]) -> Toml:
    def quantity(value: Any, unit: str) -> Toml:
        return {"value": value, "unit": unit, "source": "x"}

    return {
        "name": name,
        "direction": {"value": direction, "source": "x"},
        "position": quantity([-0.6, 0.1, 0.05], "m"),
        "lift": quantity(9.0, "N.s2/(m2.rad)"),
        "drag": quantity(3.0, "N.s2/(m2.rad2)"),
        "angle_max": quantity(0.4, "rad"),
    }


def parsed(path: Path) -> Toml:
    """Return the tables of a vehicle file."""
    found: Toml = tomlkit.parse(path.read_text(encoding="utf-8")).unwrap()
    return found


def random_file(rng: random.Random) -> Toml:
    """Return a vehicle file with random numbers, without some of the effects, and with more curves and fins."""
    path = rng.choice([THRUST_EFFECTS, THRUST_EFFECTS, EVERYTHING, SIX_AXES])
    data = parsed(path)
    data.pop("alternatives", None)
    data.pop("estimates", None)
    for table in [*data["curves"].values(), *data["axes"].values()]:
        for key, value in table.items():
            if isinstance(value, dict) and isinstance(value.get("value"), float) and key not in ("n_V", "V_0"):
                value["value"] *= rng.uniform(0.8, 1.25)
                value.pop("interval", None)
    for curve in data["curves"].values():
        for keys in (("d", "d_reverse"), ("T",)):
            if rng.random() < 0.3:
                for key in keys:
                    curve.pop(key, None)
    if rng.random() < 0.5:
        data.pop("commands", None)
    data["axes"]["heave"]["F_0"] = {"value": rng.uniform(-3.0, 3.0), "unit": "N", "source": "x"}
    if "inputs" not in data:
        data["fin"] = [*data.get("fin", []), _fin("sternplane", [0.0, 0.0, 1.0]), _fin("keel", [0.0, 1.0, 0.0])]
    if "battery" in data:
        table, second = {"table": "thrust_16_v.csv"}, {"voltage": 16.0, "table": "thrust_16_v.csv"}
        measured = rng.choice([table, {"tables": [{"voltage": 12.0, "table": "thrust_12_v.csv"}, second]}])
        data["curves"]["spare"] = copy.deepcopy(measured)
        data["thruster"].append(copy.deepcopy(data["thruster"][0]) | {"name": "spare", "curve": "spare"})
    return data


def parts_of(data: Toml) -> dict[str, list[str]]:
    """Return the names in a vehicle file."""
    driven = [part["name"] for part in (*data["thruster"], *data.get("fin", []))]
    return {"curves": [*data["curves"]], "driven": driven, "inputs": [*data.get("inputs", {})]}


def random_names(rng: random.Random, data: Toml, layout: Layout) -> Names:
    """Return new names for most parts: dangerous words, and pieces of the names in the equation."""
    equation = equation_of(layout)
    known = [*layout.places, *equation.program, *equation.forces, *equation.tables]
    pieces = []
    for name in known:
        cut = rng.choice([n for n, letter in enumerate(name) if letter == "_"] or [0])
        pieces.append(rng.choice([name[cut + 1 :], name[:cut], name])[:30] or name)
    found: Names = {}
    for kind, names in parts_of(data).items():
        new: dict[str, str] = {}
        for name in names:
            choices = [
                rng.choice(EVIL),
                rng.choice(pieces),
                f"{rng.choice(names)}_{rng.choice(['1', 'reverse'])}",
                name,
            ]
            free = [one for one in choices if one.lower() not in {other.lower() for other in new.values()}]
            new[name] = rng.choice(free or [f"part{len(new)}"])
        found[kind] = new
    return found


def renamed(data: Toml, names: Names) -> Toml:
    """Return a vehicle file with other names of its parts."""
    data = copy.deepcopy(data)
    curves, driven, inputs = (names.get(kind, {}) for kind in ("curves", "driven", "inputs"))
    data["curves"] = {curves.get(name, name): curve for name, curve in data["curves"].items()}
    for part in (*data["thruster"], *data.get("fin", [])):
        part["name"] = driven.get(part["name"], part["name"])
        if "curve" in part:
            part["curve"] = curves.get(part["curve"], part["curve"])
    if "inputs" in data:
        data["inputs"] = {
            inputs.get(name, name): {driven.get(one, one): gain for one, gain in gains.items()}
            for name, gains in data["inputs"].items()
        }
    return data


def load(data: Toml, folder: Path) -> Vehicle:
    """Return the vehicle of a file."""
    for table in ("thrust_12_v.csv", "thrust_16_v.csv"):
        shutil.copy(THRUST_EFFECTS.with_name(table), folder)
    path = folder / "vehicle.toml"
    path.write_text(tomlkit.dumps(data), encoding="utf-8")
    return load_vehicle(path)


# ---- Equal motion ----------------------------------------------------------------------------------------------------


def check_c(plain: Vehicle, other: Vehicle) -> None:
    """Check that the C of two vehicles differs in names only, and that different names stay different.

    A new name must not be a word of the C sources, because it could have another meaning there.
    """
    new: dict[str, str] = {}
    for text, renamed_text in zip(sources(plain.layout).values(), sources(other.layout).values(), strict=True):
        one, two = (_COMMENT.sub(" ", c) for c in (text, renamed_text))
        assert _WORD.sub("", one) == _WORD.sub("", two)
        for word, renamed_word in zip(_WORD.findall(one), _WORD.findall(two), strict=True):
            assert new.setdefault(word, renamed_word) == renamed_word, word
    assert len({*new.values()}) == len(new)
    assert not {renamed_word for word, renamed_word in new.items() if renamed_word != word} & FIXED


def check_python(rng: random.Random, plain: Vehicle, other: Vehicle) -> None:
    """Check that two vehicles move equally to the last bit, with equal derivatives, and equal V_ss and Tau."""
    pair = plain, other
    inputs, state = random_inputs(rng, plain), random_state(rng, plain)
    named = [
        (
            dict(zip(rov.layout.inputs, inputs.values(), strict=True)),
            dict(zip(rov.layout.state, state.values(), strict=True)),
        )
        for rov in pair
    ]

    def same(numbers: Callable[[Vehicle, dict[str, float], dict[str, float]], Iterable[float]]) -> None:
        one, two = (np.array([*numbers(rov, *values)]) for rov, values in zip(pair, named, strict=True))
        assert np.array_equal(one, two, equal_nan=True)

    h = rng.uniform(0.01, 0.5)
    same(lambda rov, inputs, state: rov.calculated(inputs, state).values())
    same(lambda rov, inputs, state: rov.derivatives(inputs, state).values())
    same(lambda rov, inputs, state: rov.step(inputs, state, h).values())

    def jacobian(rov: Vehicle, inputs: dict[str, float], state: dict[str, float]) -> Iterable[float]:
        found = step_jacobian(rov, inputs, state, h, [*rov.layout.coefficients])
        return [*found.after.values(), *np.hstack([found.states, found.inputs, found.coefficients]).flat]

    same(jacobian)
    driven = [form.axis for form in plain.layout.axes if plain.layout.drivers(form.axis)]
    same(lambda rov, *_: [x for axis in driven for c in (0.4, -0.7) for x in rov.response(axis, c)])


def check_engine(rng: random.Random, plain: Vehicle, other: Vehicle) -> None:
    """Check that the FMU's C moves two vehicles equally to the last bit."""
    inputs = random_inputs(rng, plain)
    found = [
        simulate(rov, np.linspace(0.0, 3.0, 31), dict(zip(rov.layout.inputs, inputs.values(), strict=True)))
        for rov in (plain, other)
    ]
    assert np.array_equal(found[0].values, found[1].values, equal_nan=True)


Check = Callable[[random.Random, Vehicle, Vehicle], None]
IN_TEXT: tuple[Check, ...] = (lambda _, plain, other: check_c(plain, other), check_python)


def check_renamed(rng: random.Random, data: Toml, names: Names, folder: Path, checks: Iterable[Check]) -> Vehicle:
    """Check that a renamed vehicle moves as before, and return it."""
    plain, other = load(data, folder), load(renamed(data, names), folder)
    assert [*other.coefficients] == [*other.layout.coefficients]
    assert len(other.coefficients) == len(plain.coefficients)
    for check in checks:
        check(rng, plain, other)
    return other


SHOWN: dict[str, tuple[Names, tuple[str, ...]]] = {
    "a table of one curve and the second table of another": ({"curves": {"bow": "main_1"}}, ()),
    "a loss of thrust and the change of a velocity": ({"curves": {"bow": "v"}}, ()),
    "a loss of thrust and the change of a command": ({"curves": {"bow": "u_l"}}, ()),
    "a force that begins like a force": ({"driven": {"l": "F_1", "top": "F_F_1"}}, ()),
    "the functions of tables": ({"driven": {"bow": "force", "l": "slope", "r": "interval"}}, ()),
    "two fins": ({"driven": {"top": "t", "rudder": "max_rudder", "keel": "rudder"}}, ()),
    "two curves, one in reverse": ({"curves": {"bow": "main_reverse"}}, ("d_main_reverse_2",)),
    "a lag and the dead time": ({"curves": {"main": "d"}}, ("T_d_2",)),
    "a fin and a lift": ({"driven": {"rudder": "v_u_r"}}, ()),
    "a thrust and a load": ({"driven": {"l": "0_w"}}, ("F_0_w_2",)),
}
"""For each case, new names of parts, and the coefficients that get a number in the FMU."""


@pytest.mark.parametrize("name", SHOWN)
def test_equal_names_get_a_number(name: str, tmp_path: Path) -> None:
    names, numbered = SHOWN[name]
    data = parsed(THRUST_EFFECTS)
    data["fin"].append(_fin("keel", [0.0, 1.0, 0.0]))
    if name == "a fin and a lift":
        data["cross"] = {"Y_ur": {"value": 3.0, "unit": "N.s2/(m.rad)", "source": "x"}}
    if name == "a thrust and a load":
        data["axes"]["heave"]["F_0"] = {"value": 3.0, "unit": "N", "source": "x"}
    other = check_renamed(random.Random(1), data, names, tmp_path, IN_TEXT)
    assert tuple(name for name in other.coefficients if name.endswith("_2")) == numbered


@pytest.mark.parametrize(
    ("seed", "vehicles", "checks"),
    [
        (8, 1, IN_TEXT),
        pytest.param(2, 12, (*IN_TEXT, check_engine), marks=pytest.mark.long),
        pytest.param(3, 300, IN_TEXT, marks=pytest.mark.weekly),
    ],
    ids=["one vehicle", "some vehicles", "many vehicles"],
)
def test_random_names_change_nothing(seed: int, vehicles: int, checks: Iterable[Check], tmp_path: Path) -> None:
    rng = random.Random(seed)
    for _ in range(vehicles):
        data = random_file(rng)
        check_renamed(rng, data, random_names(rng, data, load(data, tmp_path).layout), tmp_path, checks)


def test_two_thrust_tables_must_not_have_the_same_name(tmp_path: Path) -> None:
    layout = load(parsed(THRUST_EFFECTS), tmp_path).layout
    tables = [replace(table, name="t") for curve in layout.curves for table in curve.tables]
    curves = [replace(curve, tables=tuple(tables)) if curve.tables else curve for curve in layout.curves]
    with pytest.raises(ValueError, match="two thrust tables have the same name"):
        equation_of(replace(layout, curves=tuple(curves)))
