"""The connections of a system: from names in a plan to pairs of variables, with every check."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import dropwhile
from typing import NamedTuple

from rov_fmu.bridges.system.part import Part, kind_of
from rov_fmu.io.messages import RovError, listed, only, shown

_CAUSALITIES = ("output", "input")


class Connection(NamedTuple):
    """A connection from an output to an input, each a component and a variable."""

    start: tuple[str, str]
    end: tuple[str, str]
    factor: float = 1.0
    """By what the value is multiplied on its way."""


class MismatchError(RovError, ValueError):
    """Two ends cannot be connected; the message is the reason."""


def connected(first: str, second: str, factor: float, parts: Mapping[str, Part]) -> list[Connection]:
    """Return the connections for a line of a plan: one of two variables, or several of two terminals.

    Raises MismatchError.
    """
    ends = [_end(text, parts) for text in (first, second)]
    is_port = [name not in parts[component].variables for component, name in ends]
    if is_port == [False, False]:
        return [checked(Connection(ends[0], ends[1], factor), parts)]
    if is_port != [True, True]:
        port, variable = (first, second) if is_port[0] else (second, first)
        raise MismatchError(f"{port} is a terminal and {variable} a variable: a terminal joins a terminal")
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
        start, end = pair if causalities[0] == "output" else pair[::-1]
        found.append(checked(Connection(start, end, factor), parts))
    return found


def _end(text: str, parts: Mapping[str, Part]) -> tuple[str, str]:
    """Return the component and the variable or terminal of a name in a plan. Raises MismatchError."""
    component, _, name = text.partition(".")
    if component not in parts:
        raise MismatchError(f"there is no component {shown(component)}{only(component, parts)}")
    part = parts[component]
    if name not in part.variables and name not in part.terminals:
        raise MismatchError(f"{component}: {part.unknown(name)}")
    return component, name


def checked(one: Connection, parts: Mapping[str, Part]) -> Connection:
    """Return a connection if its ends exist, and causalities, types and units fit. Raises MismatchError."""
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
    kinds = [*map(kind_of, variables)]
    if kinds[0] != kinds[1]:
        raise MismatchError(f"{names[0]} is of type {kinds[0]}, and {names[1]} of type {kinds[1]}")
    if one.factor != 1.0 and kinds[0] != "Real":
        raise MismatchError(f"a factor needs type Real, and {names[0]} is of type {kinds[0]}")
    units = [parts[component].unit(name) for component, name in (one.start, one.end)]
    if one.factor == 1.0 and not _are_alike(*units):
        raise MismatchError(
            f"{names[0]} is in {units[0][0]}, and {names[1]} in {units[1][0]}: "
            "a third entry is the factor that turns one into the other"
        )
    return one


def _are_alike(a: tuple[str, tuple[float, ...] | None], b: tuple[str, tuple[float, ...] | None]) -> bool:
    """Return False if two units are known and differ."""
    if not (a[0] and b[0]) or a[0] == b[0]:
        return True
    return a[1] is not None and a[1] == b[1]


def loop(connections: Sequence[Connection], parts: Mapping[str, Part]) -> list[str]:
    """Return the variables around a loop in which each output follows its input at once; none if there is no loop.

    In such a loop, the values at one time depend on themselves. A master that passes on the outputs of the step before
    would solve other equations, with a delay that may make them unstable, so a system must have none.
    """
    nexts: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for one in connections:
        nexts.setdefault(one.start, []).append(one.end)
    for component, part in parts.items():
        for output, inputs in part.direct.items():
            for name in inputs:
                nexts.setdefault((component, name), []).append((component, output))
    done: set[tuple[str, str]] = set()
    for first in nexts:
        way: dict[tuple[str, str], None] = {}
        left: list[Iterator[tuple[str, str]]] = [iter([first])]
        while left:
            node = next(left[-1], None)
            if node is None:
                left.pop()
                if way:
                    done.add(way.popitem()[0])
            elif node in way:
                return [".".join(one) for one in [*dropwhile(node.__ne__, way), node]]
            elif node not in done:
                way[node] = None
                left.append(iter(nexts.get(node, ())))
    return []
