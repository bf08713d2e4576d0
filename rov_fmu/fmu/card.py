"""The model card of a vehicle: what it is, from which data, where it holds, how far to trust it, what it leaves out.

It is made from the vehicle file alone, and is the same in the FMU's page, in the report of an identification, in the
file documentation/model_card.txt, and in the annotations of modelDescription.xml. What a speed takes is a table of its
own in the pages; the text has it in words.
"""

from collections.abc import Iterator, Mapping
from textwrap import fill

from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.forces import EXPECTED, effects_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import EVERY_COMMAND, Range
from rov_fmu.equation.units import in_degrees
from rov_fmu.io.messages import listed
from rov_fmu.io.numbers import significant
from rov_fmu.vehicle.description import UNIT_OF_RANGE
from rov_fmu.vehicle.steady import beyond_stated, speed_table
from rov_fmu.vehicle.vehicle import TUNED, Vehicle

_AXES = ("surge", "sway", "heave", "yaw", "pitch", "roll")
_WIDTH = 100
"""The width of the card as text, in characters."""


def card(vehicle: Vehicle) -> dict[str, list[str]]:
    """Return the paragraphs of the card by their headings."""
    low, high = vehicle.command_range
    made = vehicle.provenance
    data = [f"Source of the coefficients: {vehicle.source}."]
    trust = ["Its publication reports no check on unseen data."]
    holds = ["It has no thrusters: its inputs are forces from outside."]
    if vehicle.layout.actuators:
        holds = [f"Commands of {low:.0%} to {high:.0%}; beyond them the thrust curves extrapolate."]
        tested = vehicle.tested_commands
        holds += [f"Tests of each axis had commands of {tested}."] if tested else []
    holds += beyond_stated(vehicle)
    holds += [
        f"The {thrust} is negative below {c:.0%}." for thrust, c in reversing(vehicle.layout, vehicle.coefficients)
    ]
    if made:
        data.append(f"Identified from {vehicle.measured_from} by {made.tool}: {made.method}.")
        if made.inputs:
            data.append(f"The vehicle file has the {made.hash} of {listed(made.inputs)}.")
        trust = [*made.verdicts, *(f"Unseen data: {error}." for error in made.errors)]
        trust += [f"Open: {warning}." for warning in made.warnings] or ["There are no warnings."]
        holds += [f"Tested: {quantity}." for quantity in made.tested]
    if tuned := [*_tuned(vehicle)]:
        data += tuned
        trust += ["The predictions are those of the vehicle before it was tuned."] if made else []
    if points := [point.name for point in vehicle.layout.points]:
        lacking = [name for name in _AXES if name not in vehicle.layout.by_name]
        rest = f"; the vehicle does not move in {listed(lacking)}" if lacking else ""
        at = f"the point{'s' if len(points) > 1 else ''} {listed(points)}"
        holds.append(f"Forces at {at} act in {listed(vehicle.layout.by_name)}{rest}.")
    if vehicle.layout.identified:
        holds += [f"Tested: {words}." for words in map(_in_words, vehicle.layout.identified) if words]
        holds.append(
            "The output outside is 0 while the commands, velocities, roll and pitch are within these ranges or between "
            "them and 0; otherwise, it is the largest excess relative to its range."
        )
    return {
        "What it is": [f"{vehicle.name}, version {vehicle.version}. {vehicle.summary}."],
        "From which data": data,
        "Where it holds": holds,
        "How far to trust it": trust,
        "What it leaves out": [*_left_out(vehicle.layout), *vehicle.limits],
    }


def _tuned(vehicle: Vehicle) -> Iterator[str]:
    """Yield a sentence for each set of points to which coefficients were tuned."""
    sources = {name: source for name, source in vehicle.sources.items() if source.startswith(TUNED)}
    for source in dict.fromkeys(sources.values()):
        names = listed(name for name, other in sources.items() if other == source)
        yield f"{names}: {source[0].lower()}{source[1:]}."


def _in_words(known: Range) -> str:
    """Return a range that was tested in words; nothing for that of the commands, which the card has already."""
    if known.name == EVERY_COMMAND:
        return ""
    unit = UNIT_OF_RANGE[known.name]
    factor, shown = in_degrees(unit)
    velocities = {axis.velocity: f"{axis.name} velocity" for axis in AXES.values()}
    name = (velocities | {"phi": "roll", "theta": "pitch", "z": "depth"})[known.name]
    low, high = (significant(factor * end, 2) for end in (known.low, known.high))
    return f"{name}: {low} to {high} {shown}"


def card_text(vehicle: Vehicle) -> str:
    """Return the card as plain text."""
    lines = [f"Model card of {vehicle.name}"]
    for heading, paragraphs in with_speeds(vehicle).items():
        lines += ["", heading]
        lines += [
            fill(one, _WIDTH, initial_indent="- ", subsequent_indent="  ", break_long_words=False) for one in paragraphs
        ]
    return "\n".join(lines) + "\n"


def with_speeds(vehicle: Vehicle) -> dict[str, list[str]]:
    """Return the card with what speeds take in words, which is a table in the pages."""
    speeds = [*_speeds(vehicle)]
    return card(vehicle) | ({"What a speed takes": speeds} if speeds else {})


def _speeds(vehicle: Vehicle) -> Iterator[str]:
    """Yield a line for each motion with the command, thrust and electric power of some speeds."""
    for motion, rows in speed_table(vehicle):
        parts = []
        for one in rows:
            thrust = f"{significant(one.thrust, 3)} {one.axis.load}"
            power = "" if one.power is None else f" and {significant(one.power, 3)} W"
            parts.append(f"{one.velocity:.3g} {one.axis.unit} at {one.command:.0%} with {thrust}{power}")
        yield f"{motion.capitalize()}: {'; '.join(parts)}."


def reversing(layout: Layout, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
    """Yield the thrust curves that push backward at small commands, and the command at which they change sign."""
    for curve in layout.curves:
        for end, words in (("", ""), ("_reverse", " in reverse")):
            a, b = (values.get(curve.coefficient(key + end), 0.0) for key in ("a_t", "b_t"))
            if b < 0.0 < a and f"a_t{end}" in curve.keys:
                dead = values.get(curve.coefficient("c_0" + end), 0.0) if "c_0" in curve.keys else 0.0
                yield f"{curve.name} thrust{words}", dead - b / a


def _left_out(layout: Layout) -> Iterator[str]:
    """Yield what the equation of the vehicle lacks, in sentences."""
    yield from _left_out_of_motion(layout)
    yield from _left_out_of_forces(layout)
    at = "at a point" if layout.points else "as a load"
    yield f"A tether: it acts only if its force is connected {at}."
    surface, drag = ("Bottom", " Out of the water, drag acts in full.") if layout.surface else ("Surface, bottom", "")
    waves = "walls, and waves that the body changes" if layout.waves else "walls and waves"
    yield f"{surface}, {waves}.{' Depth has no limits.' if 'heave' in layout.by_name else ''}{drag}"
    level = "" if layout.has_attitude else ", horizontal"
    moving = "The velocity of the water is" if layout.waves else f"A current is steady{level} and"
    yield f"{moving} everywhere the same." if "V_N" in layout.inputs else "The water is at rest."


def _left_out_of_motion(layout: Layout) -> Iterator[str]:
    if not layout.coupled and len(layout.axes) > 1 and not layout.cross:
        yield "Coupling between the axes."
    if missing := [name for name in _AXES if name not in layout.by_name]:
        drifts = {"surge", "yaw"} <= layout.by_name.keys() and "sway" in missing
        yield f"{', '.join(missing).capitalize()}.{' The vehicle does not drift outward in a turn.' if drifts else ''}"
    if same := _mirrored(layout):
        yield f"What differs between the two directions of {same}."


def _left_out_of_forces(layout: Layout) -> Iterator[str]:
    has = {effect.missed for effect in effects_of(layout)}
    if some := [effect.missed for effect in EXPECTED if effect.missed not in has]:
        yield f"Thrusters as machines: there is no {listed(some, 'or')}."
    own_terms = {
        "added mass": any("m_a" in own.keys for own in layout.axes),
        "static drag": False,
        "a delay at the start": layout.has_dead_time,
    }
    static = listed(words for words, is_there in own_terms.items() if not is_there)
    yield f"Separate terms for {static}; β < 1 stands for a slow start."
    if "heave" in layout.by_name and not layout.restoring:
        load = "Beyond the constant load F_0_w, buoyancy" if "F_0_w" in layout.coefficients else "Buoyancy"
        yield f"{load} is neutral."


def _mirrored(layout: Layout) -> str:
    """Return, in words, which thrust curves and axes behave in reverse as forward."""
    curves = [curve.name for curve in layout.curves if "a_t_reverse" not in curve.keys and not curve.tables]
    axes = [part.axis.name for part in layout.axes if "a_d_reverse" not in part.keys]
    thrust = "thrust" if len(curves) == len(layout.curves) else f"thrust of curve {', '.join(curves)}"
    drag = "drag" if len(axes) == len(layout.axes) else f"drag in {', '.join(axes)}"
    return " and ".join([thrust] * bool(curves) + [drag] * bool(axes))
