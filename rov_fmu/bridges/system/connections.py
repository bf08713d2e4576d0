"""The connections of a system: from names in a plan to pairs of variables, with every check."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.fmus.variable import Value
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import RovError, listed, only, shown

_CAUSALITIES = ("output", "input")


class Connection(NamedTuple):
    """A connection from an output to an input, each a component and a variable."""

    start: tuple[str, str]
    end: tuple[str, str]
    factor: float = 1.0
    """By what the value is multiplied on its way."""
    offset: float = 0.0
    """What is added then."""


@dataclass(frozen=True)
class SystemStructure:
    """The FMUs of a system, and what connects them."""

    parts: dict[str, SystemFmu]
    values: dict[str, dict[str, Value]]
    """The start values of each component."""
    connections: list[Connection]
    sources: Mapping[str, str] = field(default_factory=dict)
    """The paths of the FMUs in the archive that was read."""


class MismatchError(RovError, ValueError):
    """Two ends cannot be connected; the message is the reason."""


def connected(first: str, second: str, factor: float, parts: Mapping[str, SystemFmu]) -> list[Connection]:
    """Return the connections for a line of a plan: one of two variables, or several of two terminals.

    Raises MismatchError.
    """
    ends = [_end(text, parts) for text in (first, second)]
    is_port = [name not in parts[component].variables for component, name in ends]
    if is_port == [False, False]:
        return [checked_connection(Connection(ends[0], ends[1], factor), parts, unlike=factor != 1.0)]
    if is_port != [True, True]:
        port, variable = (first, second) if is_port[0] else (second, first)
        raise MismatchError(f"{port} is a terminal and {variable} a variable: a terminal joins a terminal")
    if factor != 1.0:
        reason = "one number would change places, velocities and forces alike: `port` of a component has factors"
        raise MismatchError(f"{first} and {second} are terminals, which take no factor: {reason}")
    members = [parts[component].terminals[name] for component, name in ends]
    common = [member for member in members[0] if member in members[1]]
    if not common:
        has = [f"{text} has {', '.join([*of][:6])}" for text, of in zip((first, second), members, strict=True)]
        raise MismatchError(f"these terminals are of different kinds: {listed(has)}, so no member has its like")
    found = []
    for member in common:
        pair = [(component, of[member]) for (component, _), of in zip(ends, members, strict=True)]
        for component, name in pair:
            if name not in parts[component].variables:
                raise MismatchError(f"member {member}: {component}: {parts[component].unknown(name)}")
        causalities = [parts[component].variables[name].causality for component, name in pair]
        if sorted(causalities) != sorted(_CAUSALITIES):
            reason = f"an {causalities[0]} of {first} and an {causalities[1]} of {second}"
            raise MismatchError(f"member {member} is {reason}: one must be an output, and the other an input")
        both = [parts[component].factor(port, member) for component, port in ends]
        if causalities[0] == "input":
            pair, both = pair[::-1], both[::-1]
        factor = both[0] / both[1]
        found.append(checked_connection(Connection(pair[0], pair[1], factor), parts, unlike=factor != 1.0))
    return found


def _end(text: str, parts: Mapping[str, SystemFmu]) -> tuple[str, str]:
    """Return the component and the variable or terminal of a name in a plan. Raises MismatchError."""
    component, _, name = text.partition(".")
    if component not in parts:
        raise MismatchError(f"there is no component {shown(component)}{only(component, parts)}")
    part = parts[component]
    if name not in part.variables and name not in part.terminals:
        raise MismatchError(f"{component}: {part.unknown(name)}")
    return component, name


def checked_connection(one: Connection, parts: Mapping[str, SystemFmu], *, unlike: bool) -> Connection:
    """Return a connection if its ends exist, and causalities, types and units fit. Raises MismatchError.

    - `unlike`: True if it is told that units may differ.
    """
    for component, name in (one.start, one.end):
        if component not in parts:
            raise MismatchError(f"there is no component {shown(component)}{only(component, parts)}")
        if name not in parts[component].variables:
            raise MismatchError(f"{component}: {parts[component].unknown(name)}")
    names = [".".join(end) for end in (one.start, one.end)]
    variables = [parts[component].variables[name] for component, name in (one.start, one.end)]
    for name, variable, wanted in zip(names, variables, _CAUSALITIES, strict=True):
        if variable.causality != wanted:
            place = "begins at an output, and ends at an input"
            raise MismatchError(f"{name} has causality {variable.causality}: a connection {place}")
    kinds = [variable.kind for variable in variables]
    if kinds[0] != kinds[1]:
        raise MismatchError(f"{names[0]} is of type {kinds[0]}, and {names[1]} of type {kinds[1]}")
    if (one.factor, one.offset) != (1.0, 0.0) and kinds[0] != "Real":
        raise MismatchError(f"a factor needs type Real, and {names[0]} is of type {kinds[0]}")
    units = [variable.unit for variable in variables]
    bases = [parts[component].base(name) for component, name in (one.start, one.end)]
    if not unlike and all(units) and units[0] != units[1] and (None in bases or bases[0] != bases[1]):
        raise MismatchError(
            f"{names[0]} is in {units[0]}, and {names[1]} in {units[1]}: "
            "a third entry is the factor that turns one into the other"
        )
    return one


VELOCITIES = {"x": "vg_N", "y": "vg_E", "z": "vg_D"}
"""The members of a port that are the place of a point, each with that of its velocity."""
DIFFERENCE = "difference_{}"
"""The parameter with which an FMU takes the velocity of a port from its place."""
_FORCES = ("F_N", "F_E", "F_D")


def halves(system: SystemStructure) -> Iterator[tuple[str, str, str]]:
    """Yield the component, the port and the input, as component.variable, for each port that is connected by half.

    Place and velocity of a point belong together, and so do its motion and the force on it, where both sides have them.
    """
    parts, ends = system.parts, {one.end for one in system.connections}
    ports = {
        (component, port): names
        for component, part in parts.items()
        for port, names in part.terminals.items()
        if names.keys() & VELOCITIES.keys() and names.keys() & {*VELOCITIES.values(), *_FORCES}
    }

    def lacking(*sides: tuple[str, str]) -> str:
        """Return the input that is missing between two ports, or an empty text."""
        for member in ports[sides[0]]:
            if member in ports[sides[1]] and member not in VELOCITIES.values():
                both = [(component, ports[component, port][member]) for component, port in sides]
                inputs = [(c, name) for c, name in both if parts[c].variables[name].causality == "input"]
                if (
                    len(inputs) == 1
                    and inputs[0] not in ends
                    and inputs[0][1] not in system.values.get(inputs[0][0], {})
                ):
                    return ".".join(inputs[0])
        return ""

    for (component, port), names in ports.items():
        for pair in VELOCITIES.items():
            both = [(component, names[member]) for member in pair if member in names]
            told = [end for end in both if end in ends]
            if len(both) == 2 and len(told) == 1:
                (other,) = {*both} - {*told}
                yield component, port, ".".join(other)
    members = grouped(
        ((component, name), (port, member))
        for (component, port), names in ports.items()
        for member, name in names.items()
    )
    for one in system.connections:
        lacks = [
            lacking((one.start[0], first), (one.end[0], second))
            for first, member in members.get(one.start, ())
            for second, same in members.get(one.end, ())
            if member == same
        ]
        if lacks and all(lacks):  # a variable may be in several ports
            yield one.end[0], members[one.end][0][0], lacks[0]


def loop(system: SystemStructure) -> list[str]:
    """Return the variables around a loop in which each output follows its input at once; none if there is no loop.

    In such a loop, the values at one time depend on themselves. A master that passes on the outputs of the step before
    would solve other equations, with a delay that may make them unstable, so a system must have none.
    """
    links = TopologicalSorter[tuple[str, str]]()
    for one in system.connections:
        links.add(one.end, one.start)
    for component, part in system.parts.items():
        for output, inputs in part.direct.items():
            links.add((component, output), *((component, name) for name in inputs))
    try:
        links.prepare()
    except CycleError as error:
        around = error.args[1][1:]
        first = around.index(next(one.start for one in system.connections if one.start in around))
        return [".".join(one) for one in (*around[first:], *around[: first + 1])]
    return []
