"""The plan of a system: the TOML file that names the FMUs, and what connects them."""

from pathlib import Path
from sys import float_info
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from typing_extensions import Self

from rov_fmu.bridges.system.companion import COMPANIONS, OF_VEHICLES
from rov_fmu.fmus.description import TIME_LIMIT
from rov_fmu.io.file_kinds import SYSTEM_PLAN, check_suffix
from rov_fmu.io.messages import FileError
from rov_fmu.io.toml_file import AS_TUPLE, Beside, Finite, Name, Strict, Symbol, key_line, read_checked, rule

MOST_STEPS = 10_000_000
_MOST = 100
"""The most components, whose FMUs are all in memory."""
_MOST_NAMED = 10_000
"""The most entries of a list or a table."""


class SystemPlanError(FileError):
    """A plan of a system cannot be carried out; the text has a line for each reason."""


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= float_info.max


_StartValue = Annotated[
    Any,
    rule(
        "must be a finite number, true, false or text", lambda value: isinstance(value, bool | str) or _is_finite(value)
    ),
]
_Position = Annotated[tuple[Finite, Finite, Finite], AS_TUPLE]


def _port(given: Any) -> dict[str, tuple[str, float]]:
    """Return the variable and the factor of each member of a port. Raises ValueError with the rule."""
    named = dict(zip(given, given, strict=True)) if isinstance(given, list) and {*map(type, given)} == {str} else given
    found = {}
    for member, one in named.items() if isinstance(named, dict) else ():
        match one if isinstance(one, list) else [one, 1.0]:
            case [str(variable), factor] if _is_finite(factor) and factor:
                found[member] = variable, float(factor)
    if not found or len(found) != len(given):
        raise ValueError('must be { member = "variable", other = ["variable", factor], ... } or a list of variables')
    return found


_Port = Annotated[dict[str, tuple[str, float]], BeforeValidator(_port), Field(max_length=_MOST)]
SOURCES = ("vehicle", "fmu", "companion")
"""The keys that say which FMU a component is."""


class ComponentTable(Strict):
    """An FMU of a system. It has one of `vehicle`, `fmu` and `companion`."""

    one_of = SOURCES

    vehicle: Beside | None = None
    """A vehicle file beside the plan, or the name of a vehicle that ships. Its FMU is built for this machine."""
    fmu: Beside | None = None
    """An FMU for Co-Simulation in the folder of the plan."""
    companion: Literal[COMPANIONS] | None = None  # type: ignore[valid-type]
    """A companion that ships; `rov-fmu system --list` has their variables."""
    held: Symbol | None = Field(None, alias="for")
    """The component whose vehicle an `autopilot` holds, with gains for this vehicle and for the step, or `sensors`
    measure."""
    file: Beside | None = None
    """The table (CSV) of the companion `current`: time (s), z (m), V_N, V_E and perhaps V_D (m/s)."""
    point: Annotated[dict[Symbol, _Position], Field(max_length=_MOST)] = Field({})
    """More points of the vehicle, at which forces act: forward, starboard, down of the origin, m. Each is a port."""
    port: Annotated[dict[Symbol, _Port], Field(max_length=_MOST)] = Field({})
    """Ports of an FMU without terminals: { member = "variable", other = ["variable", factor] }, or a list of
    variables."""
    coefficients: Beside | None = None
    """A vehicle file or name. Its coefficients are start values of the FMU, which must have them."""
    start: Annotated[dict[str, _StartValue], Field(max_length=_MOST_NAMED)] = Field({})
    """Start values of inputs, states and parameters, by name. A connected input begins with that of its source."""

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        for key, needs in (("file", "companion"), ("point", "vehicle")):
            if getattr(self, key) and getattr(self, needs) is None:
                raise ValueError(f"{key} needs {needs}")
        if (self.held is not None) != (self.companion in OF_VEHICLES):
            names = " or ".join(f'"{name}"' for name in OF_VEHICLES)
            raise ValueError(f'for = "component" belongs to companion = {names}, which needs it')
        return self


def _connection(given: Any) -> tuple[str, str, float]:
    """Return a connection with its factor. Raises ValueError with the rule."""
    ends, factor = (given[:2], given[2:] or [1.0]) if isinstance(given, list) else ([], [])
    if [*map(type, ends)] != [str, str] or len(factor) != 1 or not _is_finite(factor[0]):
        raise ValueError('must be ["component.output", "component.input"] or two ports, and perhaps a factor')
    return ends[0], ends[1], float(factor[0])


_Connection = Annotated[tuple[str, str, float], BeforeValidator(_connection)]


class SystemPlan(Strict):
    """A system: FMUs that are stepped together."""

    title: Name | None = None
    """What the system is called."""
    step: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    """The time between two exchanges, s."""
    stop_time: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    """s; a whole number of steps."""
    time_limit: Annotated[float, Field(gt=0.0, le=1e6)] = TIME_LIMIT
    """The time in which the FMUs must begin, and take a step together, s; --run ends if they take longer."""
    connect: Annotated[tuple[_Connection, ...], AS_TUPLE, Field(max_length=_MOST_NAMED)] = ()
    """[["component.output", "component.input"], ...], or two ports (terminals), in any order. A third entry, of
    variables, is a number by which the value is multiplied."""
    plot: Annotated[tuple[str, ...], AS_TUPLE, Field(max_length=_MOST)] = ()
    """The variables that the plot of --run shows. The default is what passes between the components."""
    component: Annotated[dict[Symbol, ComponentTable], Field(min_length=1, max_length=_MOST)]
    """The FMUs by the names of the components."""

    @property
    def plotted(self) -> list[tuple[str, str]]:
        """The components and the variables in `plot`."""
        return [(component, name) for component, _, name in (text.partition(".") for text in self.plot)]

    @property
    def steps(self) -> int:
        """The number of steps."""
        return round(self.stop_time / self.step)


def load_system_plan(path: Path) -> SystemPlan:
    """Read the plan of a system. What its FMUs have is left to `made`. Raises SystemPlanError."""
    check_suffix(path, SYSTEM_PLAN, SystemPlanError)
    plan = read_checked(path, SYSTEM_PLAN, SystemPlan, SystemPlanError)
    steps = plan.stop_time / plan.step
    if abs(steps - round(steps)) > 1e-9 * max(1.0, steps) or not 1 <= steps <= MOST_STEPS:
        reason = f"must be a whole number of steps of {plan.step:g} s, at most {MOST_STEPS}"
        raise SystemPlanError(f"{path}: {key_line('stop_time', reason, plan.stop_time)}")
    return plan
