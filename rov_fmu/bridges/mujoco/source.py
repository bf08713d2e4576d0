"""The C of a vehicle in MuJoCo: fmu_src/mujoco/water.c, and what depends on the vehicle, printed as equation.h.

The formulas are those that `equation/python/printed.py` prints in Python. All numbers of the equation are in one
array, at places with the names V_... . What the body does is in another one: the velocities through the water, and the
rotation matrix.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache

from rov_fmu.c.compile import C_SOURCES
from rov_fmu.equation.attitude import ROTATION
from rov_fmu.equation.catalogue import BY_VELOCITY, CURRENT, CURRENT_DOWN
from rov_fmu.equation.expression import ZERO, Expression, to_c
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import CommandTable
from rov_fmu.equation.python.printed import TIME, accelerations_of, arrived, lagging
from rov_fmu.io.paths import FMU_SRC

WATER = FMU_SRC / "mujoco" / "water.c"
_BODY = {name: n for n, name in enumerate((*BY_VELOCITY, *ROTATION))}
"""The places of what the body does."""


def outer_names(layout: Layout) -> list[str]:
    """Return the names of the coefficients, and of the inputs that are no commands, in the order that the C has."""
    return [*layout.coefficients, *(name for name in layout.inputs if name not in layout.commands)]


@lru_cache(maxsize=100)
def water_sources(layout: Layout) -> dict[str, str]:
    """Return the C files of a vehicle in MuJoCo by their names. The last one includes the others."""
    equation = accelerations_of(layout).equation
    needed = {"real.h": True, "delay.c": layout.has_dead_time, "table.c": bool(equation.thrust_tables)}
    shared = {name: (C_SOURCES / name).read_text(encoding="utf-8") for name, is_needed in needed.items() if is_needed}
    return {"equation.h": _equation(layout)} | shared | {WATER.name: WATER.read_text(encoding="utf-8")}


def memory_size(layout: Layout) -> tuple[int, int]:
    """Return how many numbers a vehicle remembers from step to step, and how many more for each change that waits.

    These are N_KEPT and N_CHANGE of water.c. Without a dead time, nothing waits.
    """
    kept = 1 + len(BY_VELOCITY) + len(lagging(accelerations_of(layout).equation))
    commands = len(layout.commands)
    return (kept + commands + 1, 2 + commands) if layout.has_dead_time else (kept, 0)


def _equation(layout: Layout) -> str:
    """Print equation.h."""
    equation, numbers, mass, rates = accelerations_of(layout)
    late = {*lagging(equation)}
    for name, formula in numbers.items():
        late |= {name} if late & formula.names else set()
    used = frozenset[str]().union(*(formula.names for formula in numbers.values()))
    directions = [name for name in _BODY if name in used]
    given = [*layout.commands, *layout.acting.values(), *outer_names(layout)]
    places = dict.fromkeys([*given, *directions, *lagging(equation), *numbers])
    fractions = arrived(equation)
    in_rates = {name: f"y[{n}]" for name, n in _BODY.items()} | {name: name for name in fractions}
    sizes = {
        "N_COMMANDS": len(layout.commands),
        "FIRST_DELAYED": len(layout.commands),
        "FIRST_COEFFICIENT": len(layout.commands) + len(layout.acting),
        "N_COEFFICIENTS": len(layout.coefficients),
        "N_GIVEN": len(given),
        "N_DIRECTIONS": len(directions),
        "FIRST_LAGGING": len(given) + len(directions),
        "N_LAGGING": len(lagging(equation)),
        **dict(zip(("N_KEPT", "N_CHANGE"), memory_size(layout), strict=True)),
        "N_FORCES": len(layout.thrusters),
        "N_NUMBERS": len(places),
        "N_BODY": len(_BODY),
        "BODY_ROTATION": len(BY_VELOCITY),
    }
    current = [given.index(name) if name in given else -1 for name in (*CURRENT, *CURRENT_DOWN)]
    after = {f"after_{n}": formula for n, formula in enumerate(lagging(equation).values())}
    return f"""\
/* The equation of a vehicle for water.c: its mass matrix and accelerations (forward, starboard, down), in SI units. */
enum {{ {", ".join(f"V_{name} = {n}" for n, name in enumerate(places))} }};
enum {{ {", ".join(f"{name} = {n}" for name, n in sizes.items())} }};
#define HAS_DEAD_TIME {int(layout.has_dead_time)}
{_array("int", "DIRECTIONS", (_BODY[name] for name in directions))} /* their places in the body */
{_array("int", "FORCES", (f"V_F_{thruster.name}" for thruster in layout.thrusters))}
{_array("int", "CURRENT", current)} /* the places of the current, or -1 */
{_array("int", "LACKS", (int(name not in layout.velocities) for name in BY_VELOCITY))} /* 1 along axes that it lacks */
{_array("double", "STARTS", (layout.usual_inputs[name] for name in layout.commands))} /* of the commands */
{_tables(equation.thrust_tables)}
/* Compute the numbers that follow from coefficients, inputs and directions of motion. */
static void equation_numbers(double v[])
{{
    (void)v;
{_lines({f"v[V_{name}]": formula for name, formula in numbers.items() if name not in late})}}}

/* Compute the numbers that also follow from what lags. */
static void equation_lagged(double v[])
{{
    (void)v;
{_lines({f"v[V_{name}]": formula for name, formula in numbers.items() if name in late})}}}

/* Compute the mass matrix about the origin, with added mass and tuning. */
static void equation_mass(const double v[], double M[36])
{{
    (void)v;
{_lines({f"M[{6 * i + j}]": formula for i, row in enumerate(mass) for j, formula in enumerate(row)})}}}

/* Compute the accelerations some seconds after the numbers. They are 0 along axes that the vehicle lacks. */
static void equation_rates(const double v[], double _time, const double y[], double rate[6])
{{
    (void)v, (void)_time, (void)y;
{_lines({f"const double {name}": x for name, x in fractions.items()})}\
{"".join(f"    (void){name};{chr(10)}" for name in fractions)}\
{_lines({f"rate[{n}]": rates.get(name, ZERO) for n, name in enumerate(BY_VELOCITY)}, in_rates)}}}

/* Replace the forces and the speeds of rotors that lag by those some seconds after the numbers. */
static void equation_lag(double v[], double _time)
{{
    (void)v, (void)_time;
{_lines({f"const double {name}": formula for name, formula in after.items()})}\
{"".join(f"    v[V_{force}] = {name};{chr(10)}" for force, name in zip(lagging(equation), after, strict=True))}}}
"""


_LOCAL = {TIME.identifier: TIME.identifier}


def _in_c(formula: Expression, local: Mapping[str, str] = _LOCAL) -> str:
    """Write a formula in C. `local` has the C of names that are not in the array of numbers."""
    return to_c(formula, lambda name: local.get(name, f"v[V_{name}]"))


def _lines(formulas: Mapping[str, Expression], local: Mapping[str, str] = _LOCAL) -> str:
    """Print assignments of formulas, by what stands on the left."""
    return "".join(f"    {left} = {_in_c(formula, local)};\n" for left, formula in formulas.items())


def _array(kind: str, name: str, values: Iterable[object]) -> str:
    """Print a constant array. C has no empty ones."""
    return f"static const {kind} {name}[] = {{{', '.join(map(str, values)) or 0}}};"


def _tables(tables: Mapping[str, CommandTable]) -> str:
    """Print the functions of the thrust tables."""
    text = '#include "table.c"\n' if tables else ""
    for name, table in tables.items():
        columns: dict[str, Sequence[float]] = {
            f"commands_{name}": table.commands,
            f"values_{name}": table.values,
            f"slopes_{name}": table.slopes,
        }
        arrays = "\n".join(_array("double", column, values) for column, values in columns.items())
        text += f"""
{arrays}
static double {name}(double command)
{{
    return value_in_table({", ".join(columns)}, {len(table.commands)}, command);
}}
"""
    return text
