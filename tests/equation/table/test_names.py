"""The names of curves, thrusters, fins and inputs do not change the motion, unless two coefficients have one name.

Random vehicles are renamed at random. Names from the equation itself, such as `max_rudder` and `main_1`, and words of C
and Python are the most dangerous ones.
"""

import random
import re
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from rov_fmu.c.simulation import simulate
from rov_fmu.c.source import c_sources
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve
from rov_fmu.equation.terms import equation_of
from rov_fmu.io.paths import FMU_SRC
from rov_fmu.vehicle.checks import check_distinct_names
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import often
from tests.vehicles import (
    EVERYTHING,
    SIX_AXES,
    THRUST_EFFECTS,
    fin,
    random_body,
    random_inputs,
    random_state,
    random_vehicle,
)

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


def _with_a_keel() -> Vehicle:
    """Return a vehicle with tables of thrust, a lag, a dead time, two fins and a load."""
    rov = load_vehicle(THRUST_EFFECTS)
    axes = tuple(replace(one, keys=(*one.keys, "F_0")) if one.axis is HEAVE else one for one in rov.layout.axes)
    keel = fin("keel", (0.0, 1.0, 0.0), (-0.6, 0.1, 0.05), has_drag=True)
    layout = replace(rov.layout, axes=axes, fins=(*rov.layout.fins, keel))
    numbers = {**rov.coefficients, "lift_keel": 9.0, "drag_keel": 3.0, "angle_max_keel": 0.4, "F_0_w": 3.0}
    return Vehicle(layout, {name: numbers[name] for name in layout.coefficients})


KEELED = _with_a_keel()
FILES = [KEELED, KEELED, load_vehicle(EVERYTHING), load_vehicle(SIX_AXES)]


def random_rov(rng: random.Random) -> Vehicle:
    """Return a random vehicle, or one of a file without some of its effects."""
    rov = rng.choice([*FILES, random_vehicle(rng), random_body(rng, "uvwpqr")])
    dropped = {(curve.name, key) for curve in rov.layout.curves for key in ("d", "T") if rng.random() < 0.3}
    layout = rov.layout.with_keys(
        lambda part, key: key in part.keys and (part.suffix, key.removesuffix("_reverse")) not in dropped
    )
    layout = replace(layout, has_dead_time=layout.has_dead_time and rng.random() < 0.5)
    return Vehicle(layout, {name: rov[name] for name in layout.coefficients})


def parts_of(layout: Layout) -> dict[str, list[str]]:
    """Return the names of the parts of a vehicle."""
    driven = [part.name for part in (*layout.thrusters, *layout.fins)]
    return {"curves": [curve.name for curve in layout.curves], "driven": driven, "inputs": [*layout.mix]}


def random_names(rng: random.Random, layout: Layout) -> Names:
    """Return new names for most parts: dangerous words, and pieces of the names in the equation."""
    equation = equation_of(layout)
    pieces = []
    places = filter(str.isidentifier, layout.places)  # der(u) is the name of no part
    for name in (*places, *equation.program, *equation.forces, *equation.tables):
        cut = rng.choice([n for n, letter in enumerate(name) if letter == "_"] or [0])
        pieces.append(rng.choice([name[cut + 1 :], name[:cut], name])[:30] or name)
    found: Names = {}
    for kind, names in parts_of(layout).items():
        new: dict[str, str] = {}
        for name in names:
            of_another = f"{rng.choice(names)}_{rng.choice(['1', 'reverse'])}"
            choices = [rng.choice(EVIL), rng.choice(pieces), of_another, name]
            free = [one for one in choices if one.lower() not in {other.lower() for other in new.values()}]
            new[name] = rng.choice(free or [f"part{len(new)}"])
        found[kind] = new
    return found


def renamed(layout: Layout, names: Names) -> Layout:
    """Return a layout with other names of its parts, and tables that are named after their curves."""

    def of(kind: str, name: str) -> str:
        return names.get(kind, {}).get(name, name)

    def named(curve: Curve) -> Curve:
        new = of("curves", curve.name)
        tables = tuple(replace(table, name=f"{table.name.partition('_')[0]}_{new}") for table in curve.tables)
        return replace(curve, name=new, tables=tables)

    return replace(
        layout,
        curves=tuple(map(named, layout.curves)),
        thrusters=tuple(
            replace(one, name=of("driven", one.name), curve=of("curves", one.curve)) for one in layout.thrusters
        ),
        fins=tuple(replace(one, name=of("driven", one.name)) for one in layout.fins),
        mix={
            of("inputs", name): {of("driven", one): gain for one, gain in gains.items()}
            for name, gains in layout.mix.items()
        },
    )


def moved(rov: Vehicle, layout: Layout) -> Vehicle:
    """Return the vehicle with a layout that only has other names."""
    return Vehicle(layout, dict(zip(layout.coefficients, rov.coefficients.values(), strict=True)))


# ---- Equal motion ----------------------------------------------------------------------------------------------------


def check_c(plain: Vehicle, other: Vehicle) -> None:
    """Check that the C of two vehicles differs in names only, and that different names stay different.

    A new name must not be a word of the C sources, because it could have another meaning there.
    """
    new: dict[str, str] = {}
    for text, renamed_text in zip(c_sources(plain.layout).values(), c_sources(other.layout).values(), strict=True):
        one, two = (_COMMENT.sub(" ", c) for c in (text, renamed_text))
        assert _WORD.sub("", one) == _WORD.sub("", two)
        for word, renamed_word in zip(_WORD.findall(one), _WORD.findall(two), strict=True):
            assert new.setdefault(word, renamed_word) == renamed_word, word
    assert len({*new.values()}) == len(new)
    assert not {renamed_word for word, renamed_word in new.items() if renamed_word != word} & FIXED


Values = dict[str, float]


def comparison(
    rng: random.Random, plain: Vehicle, other: Vehicle
) -> Callable[[Callable[[Vehicle, Values, Values], Iterable[float]]], None]:
    """Return a function that compares numbers of two vehicles to the last bit, for the same inputs and states."""
    pair = plain, other
    inputs, state = random_inputs(rng, plain), random_state(rng, plain)
    named = [
        (
            dict(zip(rov.layout.inputs, inputs.values(), strict=True)),
            dict(zip(rov.layout.state, state.values(), strict=True)),
        )
        for rov in pair
    ]

    def same(numbers: Callable[[Vehicle, Values, Values], Iterable[float]]) -> None:
        one, two = (np.array([*numbers(rov, *values)]) for rov, values in zip(pair, named, strict=True))
        assert np.array_equal(one, two, equal_nan=True)

    return same


def check_python(rng: random.Random, plain: Vehicle, other: Vehicle) -> None:
    """Check that two vehicles move equally in Python, with equal derivatives, and equal V_ss and Tau."""
    same, h = comparison(rng, plain, other), rng.uniform(0.01, 0.5)
    same(lambda rov, inputs, state: rov.calculated(inputs, state).values())
    same(lambda rov, inputs, state: rov.derivatives(inputs, state).values())
    same(lambda rov, inputs, state: rov.step(inputs, state, h).values())
    driven = [form.axis for form in plain.layout.axes if plain.layout.thrusters_along(form.axis)]
    same(lambda rov, *_: [x for axis in driven for c in (0.4, -0.7) for x in rov.response(axis, c)])


def check_engine(rng: random.Random, plain: Vehicle, other: Vehicle) -> None:
    """Check that the FMU's C moves two vehicles equally."""
    same = comparison(rng, plain, other)
    same(lambda rov, inputs, _: simulate(rov, np.linspace(0.0, 3.0, 31), inputs).values.flat)


Check = Callable[[random.Random, Vehicle, Vehicle], None]
IN_TEXT: tuple[Check, ...] = (lambda _, plain, other: check_c(plain, other), check_python)


ALIKE: dict[str, Names] = {
    "a table of one curve and the second table of another": {"curves": {"bow": "main_1"}},
    "a loss of thrust and the change of a velocity": {"curves": {"bow": "v"}},
    "a force that begins like a force": {"driven": {"l": "F_1", "top": "F_F_1"}},
    "two fins": {"driven": {"top": "t", "rudder": "max_rudder", "keel": "rudder"}},
}
"""New names of parts that make quantities of the equation alike."""


@pytest.mark.parametrize("is_compiled", [False, pytest.param(True, marks=pytest.mark.weekly)])
@pytest.mark.parametrize("name", ALIKE)
def test_quantities_that_are_named_alike_stay_different(name: str, is_compiled: bool) -> None:
    """Each of these vehicles takes six seconds to compile."""
    other = moved(KEELED, renamed(KEELED.layout, ALIKE[name]))
    for check in (*IN_TEXT, check_engine) if is_compiled else IN_TEXT:
        check(random.Random(1), KEELED, other)


@often("vehicles", 1, 2, 300)
def test_random_names_change_nothing(vehicles: int) -> None:
    rng, compared = random.Random(8 + vehicles), 0
    while compared < vehicles:
        plain = random_rov(rng)
        layout = renamed(plain.layout, random_names(rng, plain.layout))
        if any(check_distinct_names(layout)):  # a vehicle file with these names is refused
            continue
        compared += 1
        for check in (*IN_TEXT, check_engine):
            check(rng, plain, moved(plain, layout))
