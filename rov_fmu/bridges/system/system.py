"""A system from its plan: everything that does not fit is told, and then its FMUs are made, with its start values."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import autopilot_model
from rov_fmu.bridges.system.companion import SENSORS, Rows, companion, lack, levels_of, slave_of, timed_rows
from rov_fmu.bridges.system.companions._common import Companion
from rov_fmu.bridges.system.connections import (
    DIFFERENCE,
    VELOCITIES,
    Connection,
    MismatchError,
    SystemStructure,
    connected,
    halves,
    loop,
)
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.bridges.system.plan import SOURCES, ComponentTable, SystemPlan, SystemPlanError
from rov_fmu.bridges.system.sensors import sensors_model
from rov_fmu.bridges.system.ssp import Component, System
from rov_fmu.build import model_fmu
from rov_fmu.equation.catalogue import before_name
from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.content import motion_model, native_content
from rov_fmu.fmu.variables import FmuModel
from rov_fmu.fmus.variable import Value
from rov_fmu.io.messages import FileError, InputError, lines_on, listed, only
from rov_fmu.io.paths import inside
from rov_fmu.io.reading import read_bytes
from rov_fmu.io.toml_file import LARGEST, key_line
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle, read_vehicle

_MOST_TOLD = 8
"""The most variables or components of a sentence that are told by their names."""
Served = dict[str, dict[str, str]]
"""The ends of the names of the places that a companion has, by whom it serves, for each companion."""
_Line = tuple[str, str, float]
_MOST_BYTES = 1_000_000_000
"""The most bytes of all FMUs, which are in memory."""


def made(plan: SystemPlan, path: Path, on_part: Callable[[str], object] = lambda _: None) -> SystemStructure:
    """Return the system of a plan, which was read from a path. `on_part` is called with what is made.

    Raises SystemPlanError with every reason, FileError about a vehicle, BuildError if its FMU cannot be built.
    """
    wrong = [
        key_line(f"component.{name}.companion", reason, table.companion)
        for name, table in plan.component.items()
        if table.companion and (reason := lack(table.companion))
    ]
    if wrong:
        raise SystemPlanError(*lines_on(path, wrong))
    served, lines = _served(plan)
    parts = _parts(plan, path, served)
    system = SystemStructure(parts, {}, [])
    wrong += _set_values(plan, path, system)
    wrong += _connect(plan, lines, system)
    if not wrong:
        system.connections.extend([*_depths(served, system)])
        wrong += [*_seabeds(system), *_differences(system), *_waves_that_pass(plan, system)]
    if not wrong and (around := loop(system)):
        reason = "is a loop without delay, for each output follows its input at once: put an FMU with a state into it"
        wrong.append(f"connect: {' -> '.join(around)} {reason}")
    if wrong:
        raise SystemPlanError(*lines_on(path, wrong))
    _pass_on(system)
    ready: dict[tuple[int, str], SystemFmu] = {}
    for name, part in [*parts.items()]:
        if part.make:
            alike = id(part), repr(system.values[name])
            if alike not in ready:
                on_part(name)
                ready[alike] = part.made_for(system.values[name], plan.stop_time, plan.step)
            parts[name], system.values[name] = ready[alike], {}
            _check_size(parts, name, path)
    return system


def _parts(plan: SystemPlan, path: Path, served: Served) -> dict[str, SystemFmu]:
    """Return the FMUs of a plan; those that are made for it do not have its start values yet, and may not run.

    Components of one kind have one FMU. Raises SystemPlanError with every reason, and FileError about a vehicle.
    """
    parts, unread = dict[str, SystemFmu](), list[str]()
    tables = _tables(plan, path, unread)
    levels = max(map(levels_of, tables.values()), default=0)
    ready: dict[str, SystemFmu] = {}
    for name, table in plan.component.items():
        others = served.get(name, {})
        is_in_waves = bool(_slave(plan, name).nodes) and any(f"{name}.waves" in line[:2] for line in plan.connect)
        own = table.model_dump_json(include={*SOURCES, "file", "point", "port", "held"})
        kind = f"{own}{others}{is_in_waves}"
        try:
            if kind not in ready:
                if table.fmu:
                    part = SystemFmu.open(inside(path.parent, table.fmu))
                elif table.companion and not table.held:
                    lines = {other: nodes for other in others if (nodes := _slave(plan, other).nodes)}
                    make = partial(
                        companion,
                        table.companion,
                        rows=tables.get(name),
                        places=[other for other, suffix in others.items() if suffix and other not in lines],
                        levels=levels,
                        lines=lines,
                        waves=is_in_waves,
                    )
                    part = SystemFmu.open(Path(table.companion), make(), is_ours=True, make=make)
                else:
                    held = _of_vehicle(name, plan, path) if table.held else None
                    part = _described(held or motion_model(_vehicle(name, table, path)))
                ready[kind] = part.with_ports(table.port)
        except FileError as error:
            where = f"{path}: component.{name}.fmu: " if table.fmu else ""
            unread += [f"{where}{line}" for line in str(error).split("\n")]
        except ValueError as error:
            unread += lines_on(path, [f"component.{name}.port.{error}"])
        else:
            parts[name] = ready[kind]
            _check_size(parts, name, path)
    if unread:
        raise SystemPlanError(*unread)
    return parts


def _check_size(parts: Mapping[str, SystemFmu], name: str, path: Path) -> None:
    """Raise SystemPlanError, which names the last component, if the FMUs are too large together."""
    if sum(len(part.content) for part in parts.values()) > _MOST_BYTES:
        raise SystemPlanError(f"{path}: component.{name}: the FMUs have more than {_MOST_BYTES:,} bytes in all")


def _described(model: FmuModel) -> SystemFmu:
    """Return what the FMU of a model will have, before the compilation takes its time."""

    def make(start: Mapping[str, Value], experiment: tuple[float, float]) -> bytes:
        return model_fmu(model.begun(start, *experiment), ["host"])

    content = archive(native_content(model, interface="cs").files)
    return SystemFmu.open(Path(f"{model.identifier}.fmu"), content, is_ours=True, make=make)


def _tables(plan: SystemPlan, path: Path, unread: list[str]) -> dict[str, Rows]:
    """Return the rows of the table of each companion that has one, and collect what is wrong with them."""
    found: dict[str, Rows] = {}
    for name, table in plan.component.items():
        if table.file and table.companion:
            columns = slave_of(table.companion).columns
            try:
                if not columns:
                    raise FileError(f"{path}: component.{name}.file: the companion {table.companion} takes no file")
                found[name] = timed_rows(inside(path.parent, table.file), columns)
            except FileError as error:
                unread.append(str(error))
    return found


def _served(plan: SystemPlan) -> tuple[Served, list[list[_Line]]]:
    """Return whom each companion serves at places of their own, and for each line of the plan those between places.

    The first vehicle has the terminals of the companion, and the others those that end with their names; so has each
    tether, which feels waves at many points. What is behind the water of a companion serves all whom that one serves.
    """
    served: Served = {}

    def named(end: str, other: str) -> str:
        """Return the name of an end for whom it serves."""
        component, _, name = end.partition(".")
        slave, nodes = _slave(plan, component), _slave(plan, other).nodes
        if name == slave.behind:
            return f"{end}{served.get(component, {}).get(other, '')}"
        if name not in dict(slave.places) or (nodes and name != "waves"):
            return end
        others = served.setdefault(component, {})
        return f"{end}{others.setdefault(other, f'_{other}' if nodes or '' in others.values() else '')}"

    slaves = {component: _slave(plan, component) for component in plan.component}
    seas = {f"{component}.{one.behind}": component for component, one in slaves.items() if one.behind}
    lines: list[list[_Line]] = [[] for _ in plan.connect]
    order = sorted(enumerate(plan.connect), key=lambda one: not seas.keys().isdisjoint(one[1]))  # seas last
    for n, (first, second, factor) in order:
        others = served.get(seas.get(first) or seas.get(second, ""), {})
        for other in [name for name in others if not _slave(plan, name).nodes] or [""]:
            ends = (named(first, other or second.partition(".")[0]), named(second, other or first.partition(".")[0]))
            lines[n].append((*ends, factor))
    return served, lines


def _slave(plan: SystemPlan, component: str) -> type[Companion]:
    """Return the class of a component that is a companion; of any other one, that of a companion without more."""
    table = plan.component.get(component)
    return slave_of(table.companion) if table and table.companion else Companion


def of_vehicle(companion: str, vehicle: Vehicle, step: float) -> FmuModel:
    """Return the model of a companion that is made for a vehicle and a step, s. Raises InputError."""
    return sensors_model(vehicle, step) if companion == SENSORS else autopilot_model(autopilot_of(vehicle, step))


def _of_vehicle(name: str, plan: SystemPlan, path: Path) -> FmuModel:
    """Return the model of the companion of a component's vehicle, for the step of the plan. Raises FileError."""
    held = plan.component[name].held or ""
    table = plan.component.get(held)
    if not table or not table.vehicle:
        has = [one for one, other in plan.component.items() if other.vehicle]
        reason = f"must be a component that has a vehicle{only(held, has)}"
        raise SystemPlanError(f"{path}: {key_line(f'component.{name}.for', reason, held)}")
    try:
        return of_vehicle(plan.component[name].companion or "", _vehicle(held, table, path), plan.step)
    except InputError as error:
        raise SystemPlanError(f"{path}: {key_line(f'component.{name}.for', str(error), held)}") from error


def _vehicle(name: str, table: ComponentTable, path: Path) -> Vehicle:
    """Return the vehicle of a component with the points of the plan. Raises FileError."""
    file = named_in(path, f"component.{name}.vehicle", table.vehicle or "", SystemPlanError)
    points = "".join(
        f'\n[[point]]\nname = "{point}"\n'
        f'position = {{ value = {[*position]}, unit = "m", source = "the plan of a system" }}\n'
        for point, position in table.point.items()
    )
    return read_vehicle(file, read_bytes(file, VehicleFileError, most=LARGEST) + points.encode())


def _set_values(plan: SystemPlan, path: Path, system: SystemStructure) -> Iterator[str]:
    """Fill in the start values, and yield a line for each that does not fit."""
    for name, table in plan.component.items():
        part, values = system.parts[name], system.values.setdefault(name, {})
        key = f"component.{name}"
        given: dict[str, tuple[str, Value]] = {}
        if table.coefficients:
            file = named_in(path, f"{key}.coefficients", table.coefficients, SystemPlanError)
            own = load_vehicle(file).coefficients
            given = {one: (f"{key}.coefficients: {one}", value) for one, value in own.items()}
        given |= {one: (f"{key}.start.{one}", value) for one, value in table.start.items()}
        for one, (where, value) in given.items():
            try:
                values[one] = part.start_value(one, value)
            except ValueError as error:
                yield key_line(where, str(error), value)
        if table.companion and "step" in part.variables:
            values.setdefault("step", plan.step)


def _connect(plan: SystemPlan, lines: Sequence[Sequence[_Line]], system: SystemStructure) -> Iterator[str]:
    """Fill in the connections of some lines, and yield a line of the plan for each that does not fit."""
    parts = system.parts
    taken: dict[tuple[str, str], int] = {}
    for n, (given, some) in enumerate(zip(plan.connect, lines, strict=True), 1):
        try:
            found = [one for line in some for one in connected(*line, parts)]
            for one in found:
                if one.end in taken:
                    before = taken[one.end]
                    where = f"connect#{before} connects it too" if before < n else "this line connects it twice"
                    raise MismatchError(f"{'.'.join(one.end)} takes one connection, and {where}")
                taken[one.end] = n
        except MismatchError as error:
            yield key_line(f"connect#{n}", str(error), [*given[:2]])
            continue
        system.connections.extend(found)
    for component, name in plan.plotted:
        has = parts[component].variables if component in parts else {}
        if name not in has or has[name].kind == "String":
            yield key_line("plot", "must name variables that are numbers, as component.variable", f"{component}.{name}")


def _pass_on(system: SystemStructure) -> None:
    """Give connected inputs the start values of their sources, where the plan has these.

    Otherwise a current at depth would begin with that at the surface, and jump at the first exchange.
    """
    values = system.values
    for (source, output), (component, name), factor, _ in system.connections:
        if output in values[source] and name not in values[component]:
            value = values[source][output]
            with suppress(ValueError):  # it is not within the bounds of the input
                passed = value if factor == 1.0 else factor * float(value)
                values[component][name] = system.parts[component].start_value(name, passed)


def _depths(served: Served, system: SystemStructure) -> Iterator[Connection]:
    """Yield the connections that tell a companion where the vehicles are that it serves, if nothing else tells it."""
    parts, ends = system.parts, {one.end for one in system.connections}
    for component, others in served.items():
        for other, suffix in others.items():
            for member, name in parts[component].terminals[f"pose{suffix}"].items():
                if (
                    (component, name) not in ends
                    and name not in system.values[component]
                    and member in parts[other].names("output")
                ):
                    yield Connection((other, member), (component, name))


def _seabeds(system: SystemStructure) -> Iterator[str]:
    """Give what moves a tether the seabed that only the tether was told, and yield a line where they differ."""
    parts, values = system.parts, system.values
    moved = {
        (one.start[0], one.end[0]): None
        for one in system.connections
        for terminal in ("profile", "waves")
        if one.end[1] in parts[one.end[0]].terminals.get(terminal, {}).values()
    }
    for water, tether in moved:
        if "seabed" in parts[water].variables and (depth := values[tether].get("seabed")):
            other = values[water].setdefault("seabed", depth)
            if other != depth:
                reason = f"component.{water}.start.seabed is {other}: there is one seabed, which one of them is told"
                yield key_line(f"component.{tether}.start.seabed", reason, depth)


def _differences(system: SystemStructure) -> Iterator[str]:
    """Have a companion take velocities from places where only these are connected; yield a line for other halves."""
    parts = system.parts
    for component, port, lacking in halves(system):
        velocities = {f"{component}.{parts[component].terminals[port].get(name)}" for name in VELOCITIES.values()}
        if lacking in velocities and (flag := DIFFERENCE.format(port)) in parts[component].variables:
            system.values[component][flag] = True
        else:
            yield f"connect: {component}.{port} is connected by half: nothing is connected to {lacking}"


def _waves_that_pass(plan: SystemPlan, system: SystemStructure) -> Iterator[str]:
    """Yield a line for each vehicle in a seaway that keeps its velocity over ground where the water's changes."""
    for one in system.connections:
        (sea, _), (rov, name) = one.start, one.end
        if (
            plan.component[sea].companion == "seaway"
            and name == "V_N"
            and before_name(name) in system.parts[rov].variables
        ):
            reason = 'has current = "passes", which would lose the load of the waves: leave it out'
            yield f"connect: {sea}.current moves {rov}, whose vehicle file {reason}"


def unconnected(plan: SystemPlan, structure: SystemStructure) -> Iterator[str]:
    """Yield a sentence for each port, and each component with other inputs, that the plan neither connects nor sets."""
    ends = {one.end for one in structure.connections}
    for component, part in structure.parts.items():
        set_here = plan.component[component].start
        free = [name for name in part.names("input") if (component, name) not in ends and name not in set_here]
        for terminal, members in part.terminals.items():
            own = {name for name in members.values() if name in part.names("input")}
            if own and own <= {*free} and (len(own) > _MOST_TOLD or not own.issuperset(members.values())):
                yield f"{component}: the port {terminal} is not connected, so its inputs keep their start values"
                free = [name for name in free if name not in own]
            if (flag := part.variables.get(DIFFERENCE.format(terminal))) and flag.start:
                velocities = {members[name] for name in VELOCITIES.values()}
                yield f"{component}: the velocity of {terminal} is the change of its place, because it is not connected"
                free = [name for name in free if name not in velocities]
        if free:
            yield f"{component}: nothing is connected to {_listed(free)}, which keep their start values"


def elsewhere(structure: SystemStructure) -> Iterator[str]:
    """Yield a sentence about the start values, and one about the factors, that some importers of an SSP do not read."""
    tools = "FMPy's simulate_ssp and fmutool do not read"
    if own := [name for name, values in structure.values.items() if values]:
        yield f"{tools} the start values of {_listed(own)} in the SSP, nor libcosim those of outputs: set them there"
    if ends := [".".join(one.end) for one in structure.connections if one.factor != 1.0]:
        yield f"{tools} the factors of connections in the SSP, here to {_listed(ends)}: take another tool"


def _listed(names: Sequence[str]) -> str:
    """Return names in words, but not very many."""
    others = [f"{len(names) - _MOST_TOLD} others"] if len(names) > _MOST_TOLD + 1 else names[_MOST_TOLD:]
    return listed([*names[:_MOST_TOLD], *others])


def files_of(plan: SystemPlan, structure: SystemStructure, name: str) -> System:
    """Return the system as the writer of SSP takes it.

    Only inputs that are connected are connectors, because FMPy sets every one of them at every step.
    """
    components = {}
    for component, part in structure.parts.items():
        inputs = [one.end[1] for one in structure.connections if one.end[0] == component]
        outputs = part.names("output")
        types = {name: part.variables[name].kind for name in (*inputs, *outputs)}
        values = structure.values[component]
        components[component] = Component(f"{component}.fmu", part.content, values, inputs, outputs, types)
    return System(plan.title or name, components, plan.step, plan.stop_time, structure.connections)
