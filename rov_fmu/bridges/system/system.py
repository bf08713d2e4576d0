"""A system from its plan: everything that does not fit is told, and then the FMUs of vehicles are built."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from rov_fmu.bridges.system.companion import companion, lack
from rov_fmu.bridges.system.connections import Connection, MismatchError, connected, loop
from rov_fmu.bridges.system.part import Part, Value, kind_of, read_part
from rov_fmu.bridges.system.plan import SOURCES, ComponentTable, SystemPlan, SystemPlanError
from rov_fmu.bridges.system.ssp import Component, Structure, System
from rov_fmu.build import build
from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.content import native_content
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, lines_on, listed
from rov_fmu.io.paths import inside
from rov_fmu.io.reading import read_bytes
from rov_fmu.io.toml_file import LARGEST, key_line
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle, read_vehicle

_MOST_BYTES = 1_000_000_000
"""The most bytes of all FMUs, which are in memory."""


def made(plan: SystemPlan, path: Path, on_part: Callable[[str], object] = lambda _: None) -> Structure:
    """Return the system of a plan, which was read from a path. `on_part` is called with each component.

    Raises SystemPlanError with every reason, FileError about a vehicle, BuildError if its FMU cannot be built.
    """
    wrong = [
        key_line(f"component.{name}.companion", reason, table.companion)
        for name, table in plan.component.items()
        if table.companion and (reason := lack(table.companion))
    ]
    if wrong:
        raise SystemPlanError(*lines_on(path, wrong))
    parts, unread = dict[str, Part](), list[str]()
    ready: dict[str, Part] = {}
    vehicles: dict[str, Vehicle] = {}
    kinds = {  # components of one kind have one FMU
        name: table.model_dump_json(include={*SOURCES, "file", "point"}) for name, table in plan.component.items()
    }
    for name, table in plan.component.items():
        kind = kinds[name]
        try:
            if table.vehicle and kind not in ready:
                vehicles[kind] = _vehicle(name, table, path)
                ready[kind] = _description(vehicles[kind])
            elif kind not in ready:
                on_part(name)
                ready[kind] = _part(table, path)
        except FileError as error:
            where = f"{path}: component.{name}.fmu: " if table.fmu else ""
            unread += [f"{where}{line}" for line in str(error).split("\n")]
            continue
        parts[name] = ready[kind]
        _check_size(parts, name, path)
    if unread:
        raise SystemPlanError(*unread)
    values: dict[str, dict[str, Value]] = {}
    wrong += _set_values(plan, path, parts, values)
    connections = list[Connection]()
    wrong += _connect(plan, parts, connections)
    if not wrong and (around := loop(connections, parts)):
        reason = "is a loop without delay, for each output follows its input at once: put an FMU with a state into it"
        wrong.append(f"connect: {' -> '.join(around)} {reason}")
    if wrong:
        raise SystemPlanError(*lines_on(path, wrong))
    _pass_on(connections, parts, values)
    for name, kind in kinds.items():
        if vehicle := vehicles.pop(kind, None):
            on_part(name)
            ready[kind] = replace(ready[kind], content=_built(vehicle))
        parts[name] = ready[kind]
        _check_size(parts, name, path)
    return Structure(parts, values, connections)


def _check_size(parts: Mapping[str, Part], name: str, path: Path) -> None:
    """Raise SystemPlanError, which names the last component, if the FMUs are too large together."""
    if sum(len(part.content) for part in parts.values()) > _MOST_BYTES:
        raise SystemPlanError(f"{path}: component.{name}: the FMUs have more than {_MOST_BYTES:,} bytes in all")


def _part(table: ComponentTable, path: Path) -> Part:
    """Make a companion, or read an FMU. Raises FileError."""
    folder = path.parent
    if table.fmu:
        file = inside(folder, table.fmu)
        return read_part(file, read_bytes(file))
    assert table.companion
    content = companion(table.companion, inside(folder, table.file) if table.file else None)
    return read_part(Path(table.companion), content, is_ours=True)


def _vehicle(name: str, table: ComponentTable, path: Path) -> Vehicle:
    """Return the vehicle of a component with the points of the plan. Raises FileError."""
    file = named_in(path, f"component.{name}.vehicle", table.vehicle or "", SystemPlanError)
    points = "".join(
        f'\n[[point]]\nname = "{point}"\n'
        f'position = {{ value = {[*position]}, unit = "m", source = "the plan of a system" }}\n'
        for point, position in table.point.items()
    )
    return read_vehicle(file, read_bytes(file, VehicleFileError, most=LARGEST) + points.encode())


def _description(vehicle: Vehicle) -> Part:
    """Return what the FMU of a vehicle will have, before the compilation takes its time. It cannot run yet."""
    content = archive(native_content(vehicle, interface="cs").files)
    return read_part(Path(f"{vehicle.identifier}.fmu"), content, is_ours=True)


def _built(vehicle: Vehicle) -> bytes:
    """Return the FMU of a vehicle for this machine. Raises BuildError."""
    with temporary_folder("system-") as folder:
        path = Path(folder, f"{vehicle.identifier}.fmu")
        return build(vehicle, path, platforms="host", interface="cs").path.read_bytes()


def _set_values(
    plan: SystemPlan, path: Path, parts: Mapping[str, Part], values: dict[str, dict[str, Value]]
) -> Iterator[str]:
    """Fill in the start values, and yield a line for each that does not fit."""
    for name, table in plan.component.items():
        values[name] = {}
        key = f"component.{name}"
        given: dict[str, tuple[str, Value]] = {}
        if table.coefficients:
            file = named_in(path, f"{key}.coefficients", table.coefficients, SystemPlanError)
            own = load_vehicle(file).coefficients
            given = {one: (f"{key}.coefficients: {one}", value) for one, value in own.items()}
        given |= {one: (f"{key}.start.{one}", value) for one, value in table.start.items()}
        for one, (where, value) in given.items():
            try:
                values[name][one] = parts[name].start_value(one, value)
            except ValueError as error:
                yield key_line(where, str(error), value)


def _connect(plan: SystemPlan, parts: Mapping[str, Part], connections: list[Connection]) -> Iterator[str]:
    """Fill in the connections, and yield a line for each that does not fit."""
    lines: dict[tuple[str, str], int] = {}
    for n, (first, second, factor) in enumerate(plan.connect, 1):
        try:
            found = connected(first, second, factor, parts)
            for one in found:
                if one.end in lines:
                    before = lines[one.end]
                    where = f"connect#{before} connects it too" if before < n else "this line connects it twice"
                    raise MismatchError(f"{'.'.join(one.end)} takes one connection, and {where}")
                lines[one.end] = n
        except MismatchError as error:
            yield key_line(f"connect#{n}", str(error), [first, second])
            continue
        connections += found
    for component, name in plan.plotted:
        has = parts[component].variables if component in parts else {}
        if name not in has or kind_of(has[name]) == "String":
            yield key_line("plot", "must name variables that are numbers, as component.variable", f"{component}.{name}")


def _pass_on(
    connections: Iterable[Connection], parts: Mapping[str, Part], values: Mapping[str, dict[str, Value]]
) -> None:
    """Give connected inputs the start values of their sources, where the plan has these.

    Otherwise a current at depth would begin with that at the surface, and jump at the first exchange.
    """
    for (source, output), (component, name), factor in connections:
        if output in values[source] and name not in values[component]:
            value = values[source][output]
            with suppress(ValueError):  # it is not within the bounds of the input
                passed = value if factor == 1.0 else factor * float(value)
                values[component][name] = parts[component].start_value(name, passed)


def unconnected(plan: SystemPlan, structure: Structure) -> Iterator[str]:
    """Yield a sentence for each port, and each component with other inputs, that the plan neither connects nor sets."""
    ends = {one.end for one in structure.connections}
    for component, part in structure.parts.items():
        set_here = plan.component[component].start
        free = [name for name in part.names("input") if (component, name) not in ends and name not in set_here]
        for terminal, members in part.terminals.items():
            own = {name for name in members.values() if name in part.names("input")}
            if own and own <= {*free} and not own.issuperset(members.values()):
                yield f"{component}: the port {terminal} is not connected, so its inputs keep their start values"
                free = [name for name in free if name not in own]
        if free:
            yield f"{component}: nothing is connected to {listed(free)}, which keep their start values"


def files_of(plan: SystemPlan, structure: Structure, name: str) -> System:
    """Return the system as the writers of SSP and OSP take it.

    Only inputs that are connected are connectors, because FMPy sets every one of them at every step.
    """
    components = {}
    for component, part in structure.parts.items():
        inputs = [one.end[1] for one in structure.connections if one.end[0] == component]
        outputs = part.names("output")
        types = {name: kind_of(part.variables[name]) for name in (*inputs, *outputs)}
        values = structure.values[component]
        components[component] = Component(f"{component}.fmu", part.content, values, inputs, outputs, types)
    return System(plan.title or name, components, plan.step, plan.stop_time, structure.connections)
