"""What a system must know about each of its FMUs: ports, units, start values, and what follows an input at once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from rov_fmu.fmus.fmu import Fmu
from rov_fmu.fmus.variable import Value
from rov_fmu.io.messages import did_you_mean, shown

_BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "factor", "offset")
"""What makes two units the same. Radians are 1: exporters differ in whether they count them."""


_NEEDED = {
    "battery": ": write [battery] in the vehicle file",
    "electric": ": write [battery], and electric_current in its [curves], in the vehicle file",
    "waves": ": write waves = true above the tables of the vehicle file",
}
"""What a vehicle file must have for terminals that not every vehicle has."""


@dataclass(frozen=True)
class SystemFmu(Fmu):
    """An FMU for Co-Simulation that is a component of a system."""

    ports: Mapping[str, Mapping[str, tuple[str, float]]] = field(default_factory=dict)
    """More terminals: for each the variable and the factor of each member."""
    make: Callable[..., bytes] | None = None
    """Makes the FMU from its `start` values and its default `experiment`, if it is made for the system."""

    @cached_property
    def terminals(self) -> Mapping[str, Mapping[str, str]]:
        """The variables by the names of the members, for each terminal. Raises FileError."""
        own = {port: {member: name for member, (name, _) in members.items()} for port, members in self.ports.items()}
        return {**super().terminals, **own}

    def factor(self, port: str, member: str) -> float:
        """Return by what a variable is multiplied to be the member of a terminal."""
        return self.ports.get(port, {}).get(member, ("", 1.0))[1]

    @cached_property
    def direct(self) -> dict[str, list[str]]:
        """The inputs that each output follows without a step, as far as the FMU says so."""
        inputs = {*self.names("input")}
        return {
            one.variable.name: [v.name for v in one.dependencies if v.name in inputs]
            for one in self.description.outputs
            if one.dependencies
        }

    def base(self, name: str) -> tuple[float, ...] | None:
        """Return what the unit of a variable consists of; None where the FMU does not say."""
        base = self._bases.get(self.variables[name].unit)
        return tuple(float(getattr(base, key)) for key in _BASES) if base else None

    @cached_property
    def _bases(self) -> dict[str, Any]:
        return {one.name: one.baseUnit for one in self.description.unitDefinitions}

    def with_ports(self, ports: Mapping[str, Mapping[str, tuple[str, float]]]) -> "SystemFmu":
        """Return the FMU with ports. Raises ValueError with the port and the reason, and FileError."""
        names = {*self.variables, *self.terminals}
        for port, members in ports.items():
            if port in names:
                raise ValueError(f"{port}: the FMU has a variable or a terminal of this name")
            for name, _ in members.values():
                if name not in self.variables:
                    raise ValueError(f"{port}: {self.unknown(name)}")
        return replace(self, ports=ports)

    def made_for(self, start: Mapping[str, Value], stop: float, step: float) -> "SystemFmu":
        """Return the FMU with the start values of a system, and its end and step, s. Raises BuildError.

        So the system is the same in importers that do not read the start values beside an FMU.
        """
        assert self.make
        content = self.make(start=start, experiment=(stop, step))
        return replace(SystemFmu.open(self.path, content, is_ours=True), ports=self.ports)

    def unknown(self, name: str) -> str:
        """Return the message about a name that the FMU does not have."""
        names = [*self.variables, *self.terminals]
        needed = _NEEDED.get(name, "") if "body_velocity" in self.terminals else ""  # of a vehicle
        return f"the FMU has no variable or terminal {shown(name)}{needed or did_you_mean(name, names, 3)}"

    def start_value(self, name: str, value: Value) -> Value:
        """Return a start value as the type of a variable has it. Raises ValueError with the reason."""
        if name not in self.variables:
            raise ValueError(self.unknown(name))
        v = self.variables[name]
        if not v.can_be_set:
            raise ValueError("cannot be set, because the FMU computes it")
        if v.kind == "String":
            if not isinstance(value, str):
                raise ValueError("must be text in quotes")
            return value
        if isinstance(value, str) or (v.kind == "Boolean") != isinstance(value, bool):
            raise ValueError("must be true or false" if v.kind == "Boolean" else "must be a number")
        if reason := v.wrong(value):
            raise ValueError(reason)
        return value if v.kind == "Boolean" else int(value) if v.is_whole else float(value)
