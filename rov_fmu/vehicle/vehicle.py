"""The class Vehicle, and reading and checking vehicle files (TOML)."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property, lru_cache
from itertools import chain
from math import inf, isfinite, sin
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from typing_extensions import Self

from rov_fmu.equation.alone import AxisAlone, alone_formulas
from rov_fmu.equation.catalogue import ARM, YAW, Axis
from rov_fmu.equation.expression import compiled
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, Thruster, arm
from rov_fmu.equation.python.printed import printed_model
from rov_fmu.equation.python.step import Memory, heading, step
from rov_fmu.equation.terms import equation_of
from rov_fmu.equation.thrust import curve_formulas, steady_name
from rov_fmu.io.file_kinds import VEHICLE_FILE, check_keys
from rov_fmu.io.messages import FileError, InputError, did_you_mean, lines_on, listed, one_line, shown
from rov_fmu.io.reading import read_bytes
from rov_fmu.io.toml_file import LARGEST, key_line, parse_toml, problem_lines
from rov_fmu.vehicle.checks import check_parts, no_thrust
from rov_fmu.vehicle.description import PICTURES, TABLES, Provenance, StatedSpeed
from rov_fmu.vehicle.geometry import check_mass, doubts
from rov_fmu.vehicle.quantity import within
from rov_fmu.vehicle.schema import (
    DRIVING,
    FORMAT,
    NOT_GIVEN,
    UNDETERMINED,
    UNTUNED,
    Alternative,
    Basis,
    DrivenFile,
    Estimated,
    File,
    WholeFile,
    read_tables,
)

if TYPE_CHECKING:
    from numpy import float64
    from numpy.random import Generator
    from numpy.typing import NDArray

    from rov_fmu.vehicle.uncertainty import Uncertainty

BY_HAND = "set by hand"
"""The source of a coefficient that was set by `Vehicle.with_`."""
TUNED = "Tuned to"
"""How the source of a coefficient begins that `rov-fmu tune` set."""


class VehicleFileError(FileError):
    """A vehicle file that cannot be used. Each mistake is a line with file, key, value and what is allowed."""


class VehicleWarning(UserWarning):
    """A vehicle that is loaded for use has doubts in its own file. The text has `Vehicle.caution`."""


Values = Mapping[str, float]


_Vehicle = TypeVar("_Vehicle", bound="Vehicle")


class _Formulas:
    """The compiled equation of a layout."""

    def __init__(self, layout: Layout) -> None:
        equation = equation_of(layout)
        self.names = equation.names
        self.model = printed_model(layout)
        self.parameters = compiled(equation.parameters)
        self.thrust = compiled(equation.thrust, equation.measured)
        self.alone = {
            axis.name: compiled(alone_formulas(layout, axis.velocity), equation.measured) for axis in layout.bare_axes
        }


_formulas_of = lru_cache(maxsize=100)(_Formulas)
_thrust_of = cache(
    lambda curve: compiled(curve_formulas(curve), {table.function: table.value for table in curve.tables})
)


@dataclass(frozen=True)
class VehicleFile:
    """The file that a vehicle was read from."""

    path: Path
    content: bytes
    vehicle: "Vehicle" = field(repr=False)
    """The vehicle that the content describes."""


@dataclass(frozen=True, repr=False, eq=False)
class Vehicle:
    """A vehicle: its layout, its coefficients, where these come from, its file, and its motion.

    `vehicle["a_d_u"]` is a coefficient, and `vehicle.layout` has the axes, curves, thrusters and variables. A vehicle
    that is not from a file, `Vehicle(layout, coefficients)`, needs no texts and no sources. `with_` gives a changed
    vehicle. Two vehicles are equal if everything that their files would say is equal; a subclass adds only functions.
    """

    layout: Layout
    """The axes, curves, thrusters and variables."""
    coefficients: Values
    """The value of every coefficient of the layout, by name."""
    name: str = ""
    identifier: str = ""
    """A C identifier, which becomes modelIdentifier and modelName of the FMU."""
    version: str = ""
    description: str = ""
    source: str = ""
    basis: Mapping[str, Basis] = field(default_factory=dict)
    """What the coefficients rest on, by name."""
    command_range: tuple[float, float] = (0.0, 1.0)
    """The weakest and the strongest thruster command for which the model was identified."""
    tested: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """The commands along axes between which these were tested, by the names of the axes."""
    stated: Mapping[str, StatedSpeed] = field(default_factory=dict)
    """The top speeds that others state of the real vehicle, by the names of the axes."""
    alternatives: Mapping[str, Alternative] = field(default_factory=dict)
    """Other sets of published coefficients, by a name for each set."""
    data: Path | None = None
    """The folder with the published tables."""
    pictures: Path | None = None
    """The folder with the vehicle's own PICTURES, any of which may be missing."""
    limits: tuple[str, ...] = ()
    """Known effects on the vehicle that the model leaves out, in sentences."""
    provenance: Provenance | None = None
    measured_from: str = field(default="measurements", compare=False)
    """What the vehicle was identified from, in words. A vehicle file has it in a comment only."""
    file: VehicleFile | None = field(default=None, compare=False)
    """The file that was read. The vehicle may have changed since."""

    def __getitem__(self, name: str) -> float:
        """Return a coefficient."""
        return self.coefficients[name]

    def __getstate__(self) -> dict[str, object]:
        """Return what a copy has: the fields, without the compiled formulas."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def __eq__(self, other: object) -> bool:
        """Return True if the other vehicle has the same layout, numbers and texts. Their files may differ."""
        compared = (one.name for one in fields(Vehicle) if one.compare)
        return isinstance(other, Vehicle) and all(getattr(self, name) == getattr(other, name) for name in compared)

    __hash__ = None  # type: ignore[assignment]  # it has mappings, whose order does not matter

    @property
    def sources(self) -> dict[str, str]:
        """The sources of the coefficients by name."""
        return {name: one.source for name, one in self.basis.items()}

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """The 95 % confidence intervals of identified coefficients, by name."""
        return {name: one.interval for name, one in self.basis.items() if one.interval}

    @property
    def estimates(self) -> dict[str, Estimated]:
        """The standard errors and correlations of identified coefficients, by name."""
        return {name: one.estimate for name, one in self.basis.items() if one.estimate}

    @property
    def file_content(self) -> bytes | None:
        """The content of the file that was read, if the vehicle is still the one that it describes."""
        return self.file.content if self.file and self.file.vehicle == self else None

    @property
    def untuned(self) -> Self:
        """This vehicle with every α and β equal to 1: the model of the paper before it was tuned by (18)."""
        return self.with_(**dict.fromkeys(self.layout.tuning, 1.0))

    def with_(self, layout: Layout | None = None, /, **coefficients: float) -> Self:
        """Return this vehicle with other values of some coefficients, in SI units: `vehicle.with_(a_d_u=10)`.

        - `layout`: with it, the vehicle gets this layout, and keeps those of its coefficients that the layout has, too.
        - `coefficients`: the values by name. `vehicle.layout.coefficients` has the names, units and bounds. Their
          source becomes "set by hand", which also appears in the FMU and on its page, and they have no confidence
          intervals.

        A VideoRay whose left thruster has died:

            load_vehicle(find_vehicle("videoray")).with_(health_l=0.0)

        Raises InputError if the vehicle has no such coefficient, or cannot have the value.
        """
        vehicle = self._with_layout(layout) if layout else self
        values = {name: _number(name, value) for name, value in coefficients.items()}
        check_coefficients(vehicle.layout, values)
        changed = {**vehicle.coefficients, **values}
        if values and (mistake := next(_contradictions(vehicle.layout, changed), None)):
            raise InputError(mistake)
        others = vehicle.coefficients.keys() - values.keys()
        basis = {name: one.among(others) for name, one in vehicle.basis.items()}
        return replace(vehicle, coefficients=changed, basis=basis | dict.fromkeys(values, Basis(BY_HAND)))

    def _with_layout(self, layout: Layout) -> Self:
        """Return the vehicle with another layout, and with those of its coefficients that this layout has, too."""
        names = layout.coefficients.keys()
        return replace(
            self,
            layout=layout,
            coefficients={name: value for name, value in self.coefficients.items() if name in names},
            basis={name: one.among(names) for name, one in self.basis.items() if name in names},
        )

    def __repr__(self) -> str:
        """Return the name of the vehicle, its axes, its inputs, and the coefficients that were set by hand."""
        axes, inputs = ", ".join(self.layout.by_name), ", ".join(self.layout.commands)
        title = f"{type(self).__name__} {self.identifier}: {self.name}"
        return f"<{title}; axes {axes}; inputs {inputs}{self._by_hand('; ')}>"

    @property
    def summary(self) -> str:
        """The description, with the coefficients that were set by hand, and with the caution of the file."""
        caution = f". Caution: {self.caution}" if self.caution else ""
        return f"{self.description}{self._by_hand(' (', ')')}{caution}"

    def _by_hand(self, before: str, after: str = "") -> str:
        """Return the list of coefficients that were set by hand, or an empty text if there are none."""
        coefficients = self.layout.coefficients.items()
        sources = self.sources
        items = [f"{name} = {one.written(self[name])}" for name, one in coefficients if sources.get(name) == BY_HAND]
        return f"{before}{BY_HAND}: {', '.join(items)}{after}" if items else ""

    @property
    def files(self) -> list[Path]:
        """The existing files that belong to the vehicle file: its tables, pictures and report."""
        measured = [table for curve in self.layout.curves for table in (*curve.tables, curve.electric_current)]
        paths = [
            *(self.data and self.data / name for name in chain(*TABLES.values())),
            *(table and table.path for table in measured),
            *(self.pictures and self.pictures / name for name in PICTURES),
            self.provenance and self.provenance.report,
        ]
        return [path for path in paths if path and path.is_file()]

    @property
    def uncertainty(self) -> "Uncertainty":
        """The joint distribution of the coefficients that have a confidence interval."""
        from rov_fmu.vehicle.uncertainty import uncertainty  # NumPy and SciPy: few need it

        return uncertainty(self.layout, self.coefficients, self.intervals, self.estimates)

    def draws(self, count: int, generator: "Generator", *, forced: bool = False) -> dict[str, "NDArray[float64]"]:
        """Return the coefficients of `count` vehicles, drawn from what is known about this one, by their names.

        These are the sets of `rov-fmu export --draws`, of `RovVectorEnv`, and of a study with `vary_from` and the
        sampler "random", for equal seeds. Raises InputError if nothing is known, or unless `forced`, if the model of an
        axis may not be trusted.
        """
        known = self.uncertainty
        if not known.names:
            raise InputError(f"{self.identifier}: no coefficient has a confidence interval, so nothing can be drawn")
        if not forced and (axes := self.unfit_axes):
            raise InputError(
                f"{self.identifier}: nothing is drawn, because the draws do not show how far these axes may be off: "
                f"{', '.join(axes)}; --force (in Python, forced) draws all the same"
            )
        return dict(zip(known.names, known.drawn(generator.random((count, len(known.names)))).T, strict=True))

    @property
    def unfit_axes(self) -> list[str]:
        """The axes whose verdict is neither good nor usable, each with its verdict: `yaw: do not use`.

        An axis without a verdict, or in a file without verdicts an axis of which no coefficient has an interval, was
        not identified.
        """
        words = self.provenance.words if self.provenance else {}
        if not words:
            places = [keys for name, keys in self.layout.keys_in_file.items() if name in self.intervals]
            words = {keys[1]: "usable" for keys in places if keys[0] == "axes"}
        found = {axis: words.get(axis, "not identified") for axis in self.layout.by_name}
        return [f"{axis}: {word}" for axis, word in found.items() if word not in ("good", "usable")]

    @property
    def unknown_lags(self) -> list[str]:
        """A sentence for each lag of thrusters that is not known, on which gains and fast motions rest: no test tells
        it, or its 95 % interval is wider than the lag."""
        sentences = []
        for curve in (curve for curve in self.layout.curves if curve.has_lag):
            lag, basis = self[curve.coefficient("T")], self.basis.get(curve.coefficient("T"), Basis(""))
            if basis.source == UNDETERMINED or (basis.interval and basis.interval[1] > 2.0 * lag):
                ends = " ({:.2g} to {:.2g} s)".format(*basis.interval) if basis.interval else ""
                sentences.append(f"the lag of {curve.name} thrust is not known{ends}, and {lag:.2g} s is assumed")
        return sentences

    @property
    def tested_commands(self) -> str:
        """The commands between which each axis was tested, in words; nothing if the file does not tell them."""
        return listed(f"{name} from {low:.0%} to {high:.0%}" for name, (low, high) in self.tested.items())

    @property
    def doubts(self) -> list[str]:
        """A sentence for what its own file says against the vehicle: axes whose verdict is neither good nor usable,
        and lags that no test tells."""
        made = self.provenance
        if not (made and made.words and (unfit := self.unfit_axes)):
            return self.unknown_lags
        page = made.report.name if made.report else "[provenance] of the vehicle file"
        return [f"not every axis may be trusted ({', '.join(unfit)}), and {page} has the reasons", *self.unknown_lags]

    @property
    def caution(self) -> str:
        """The doubts, and the commands beyond which no test went, in one line, which is told wherever the vehicle goes.

        It is empty for a vehicle whose file says nothing of this kind, such as a published one.
        """
        is_narrow = any(low > -1.0 or high < 1.0 for low, high in self.tested.values())
        tested = [f"tests had commands of {self.tested_commands}, and none beyond"] if is_narrow else []
        return "; ".join([*self.doubts, *tested])

    @property
    def unidentified(self) -> list[Axis]:
        """The axes that the verdicts call *not identified*, so that no number of their motion is told."""
        words = self.provenance.words if self.provenance else {}
        return [axis for axis in self.layout.bare_axes if words.get(axis.name) == "not identified"]

    @property
    def shown_axis(self) -> Axis:
        """The axis of examples: the first one that is identified, or without any the first one."""
        axes = self.layout.bare_axes
        return next((axis for axis in axes if axis not in self.unidentified), axes[0])

    def picture(self, name: str) -> Path | None:
        """Return the path of the vehicle's own picture with this name, or None."""
        own = self.pictures / name if self.pictures else None
        return own if own and own.is_file() else None

    @cached_property
    def _formulas(self) -> _Formulas:
        return _formulas_of(self.layout)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """The numbers that follow from the coefficients, by their names in rov_fmu/equation/terms.py: gain_u ..."""
        return self._formulas.parameters(self.coefficients)

    # ---- Thrust ----

    def curve_force(self, curve: Curve, command: float, voltage: float | None = None) -> float:
        """Return the steady thrust (2) of one thruster (N) for a fraction of the full command, at the usual voltage or
        another one (V)."""
        values = {**self.coefficients, **self.layout.usual_inputs, "u_one": command}
        if voltage is not None:
            values["voltage"] = voltage
        *_, force = _thrust_of(curve)(values).values()
        return float(force)

    def commanded(self, inputs: Values) -> dict[str, float]:
        """Return the steady thrust of every thruster (N), by its name, for the commands."""
        values = self._steady(inputs)
        names = self._formulas.names
        return {
            name: values[steady_name(name, curve, names).identifier] for name, curve in self.layout.curve_of.items()
        }

    def _steady(self, inputs: Values) -> dict[str, float]:
        """Return the values of all formulas from the commands to the steady thrust."""
        return self._formulas.thrust({**self.coefficients, **inputs, **self._acting(inputs)})

    def _acting(self, inputs: Values) -> dict[str, float]:
        """Return the commands that act after the dead time and the current before: those given, or the present ones."""
        kept = self.layout.acting | self.layout.before
        return {later: inputs.get(later, inputs[name]) for name, later in kept.items()}

    def _values(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the coefficients, the inputs and the states by name. Other names in the mappings are left out."""
        return {
            **self.coefficients,
            **{name: inputs[name] for name in self.layout.inputs},
            **self._acting(inputs),
            **{name: state[name] for name in self.layout.state},
            **{name: state[name] for name in self.layout.continued if name in state},
        }

    def _outputs(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the rates of the states and the calculated variables, together with all numbers that they need."""
        values: dict[str, float] = self._formulas.model.outputs(self._values(inputs, state))
        return values

    def calculated(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the values of `layout.calculated` by name: thrust (N), torque (N.m) and Euler angles (rad).

        The arguments are those of `step`. At 30 % of both rear thrusters:

            rov = load_vehicle(SHIPPED["videoray"])
            inputs = rov.layout.usual_inputs | {"u_l": 0.3, "u_r": 0.3}
            rov.calculated(inputs, rov.layout.at_rest)["F_l"]  # the thrust of the left one, N
        """
        values = self._outputs(inputs, state)
        for name in self.layout.continued:
            values[name] = heading(values, state.get(name, values[name]))
        return {name: values[name] for name in self.layout.calculated}

    def effect(self, thruster: Thruster, axis: Axis) -> float:
        """Return the force along an axis per newton of a thruster, or the torque per newton (m)."""
        effect = thruster.effect(axis)
        by_arm = axis is YAW and thruster.position is None and thruster.arm
        return effect * arm(*(self[name] for name in ARM)) if by_arm else effect

    # ---- Motion ----

    def derivatives(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the time derivatives of the states by their names, in m/s2, rad/s2, m/s, rad/s and N/s.

        The arguments are those of `step`. M nu' + C nu + D nu + g = tau is solved for nu'; eta' follows from nu and the
        current.

            rov.derivatives(rov.layout.usual_inputs | {"u_t": 0.5}, rov.layout.at_rest)["w"]  # m/s2, down
        """
        values = self._outputs(inputs, state)
        return {name: values[f"der_{name}"] for name in self.layout.state}

    def step(self, inputs: Values, state: Values, h: float) -> dict[str, float]:
        """Return the states after h > 0 seconds with the inputs held, and the heading of a vehicle with an attitude.

        - `inputs`: all of `layout.inputs` by name. Commands are fractions from -1 to 1 (or pulse widths, us), loads are
          in N and N.m, the current in m/s, the voltage in V. With a dead time, the commands act at once.
        - `state`: all of `layout.state` by name, in m/s, rad/s, m, rad and N. With roll or pitch, the heading psi (rad)
          may be there too; it tells in which turn the vehicle is.
        - `h`: the length of the step, s. It need not be short.

        The result is exact up to rounding. It is not finite when the motion overflows or takes too many substeps
        (rov_fmu/equation/python/step.py). Ten seconds at full thrust ahead, from rest:

            inputs = rov.layout.usual_inputs | {"u_l": 1.0, "u_r": 1.0}
            rov.step(inputs, rov.layout.at_rest, 10.0)["u"]
        """
        after = step(self._formulas.model, self._values(inputs, state), h)
        return {name: after[name] for name in (*self.layout.state, *self.layout.continued)}

    def memory(self) -> Memory:
        """Return what is kept before the first step: no command acts or waits, and there was no other current."""
        return Memory(self.layout.usual_inputs, self.layout.acting, self.layout.before)

    # ---- One axis alone ----

    def effective_inertia(self, axis: Axis) -> float:
        """Return the effective inertia m/β (kg, kg.m2): the load per acceleration along an axis alone."""
        gain = self.parameters[self._formulas.names("gain", axis.velocity).identifier]
        return 1.0 / gain if gain > 0.0 else inf

    def alone(self, axis: Axis, inputs: Values) -> AxisAlone:
        """Return the motion of an axis alone, (18), under held inputs, once the thrust is steady."""
        return self.motions(inputs, (axis,))[0]

    def motions(self, inputs: Values, axes: Sequence[Axis] = ()) -> tuple[AxisAlone, ...]:
        """Return the motion of each axis alone under held inputs, once the thrust is steady; or only of some axes."""
        values = {**self._steady(inputs), **self.parameters}
        return tuple(AxisAlone.of(self._formulas.alone[axis.name](values)) for axis in axes or self.layout.bare_axes)

    def held_inputs(self, axis: Axis, command: float) -> dict[str, float]:
        """Return all inputs: an axis driven at a fraction of the full command, the other inputs as usual."""
        return self.layout.usual_inputs | self.layout.commands_along(axis, command)

    def force(self, axis: Axis, command: float) -> float:
        """Return the steady thrust (N) or torque (N.m) along an axis before the tuning α: (9), (10), (4)."""
        return self.along(axis, self.commanded(self.held_inputs(axis, command)))

    def along(self, axis: Axis, F: Values) -> float:
        """Return the thrust (N) or torque (N.m) along an axis of thrusters with some forces, N."""
        return sum(self.effect(t, axis) * F[t.name] for t in self.layout.thrusters_along(axis))

    def side_effects(self, axis: Axis, command: float) -> Iterator[tuple[Axis, float]]:
        """Yield the other axes that a command of an axis pushes, with the force (N) or torque (N.m) along them.

        Symmetric thrusters cancel along the other axes, unless their thrust in reverse is weaker.
        """
        F = self.commanded(self.held_inputs(axis, command))
        for other in (other for other in self.layout.bare_axes if other is not axis):
            pushes = [self.effect(t, other) * F[t.name] for t in self.layout.thrusters_along(other)]
            if abs(sum(pushes)) > 1e-3 * sum(map(abs, pushes)):
                yield other, sum(pushes)

    def tested_along(self, axis: Axis) -> tuple[float, float]:
        """Return the commands along an axis between which it was tested, the lower one first."""
        return self.tested.get(axis.name, (-self.command_range[1], self.command_range[1]))

    def strongest(self, axis: Axis) -> float:
        """Return the larger of the thrusts or torques at full command in both directions, before the tuning α."""
        return max(abs(self.force(axis, c)) for c in (1.0, -1.0))

    def motion_at(self, axis: Axis, command: float) -> AxisAlone:
        """Return the motion of an axis alone, (18), under a held command, once the thrust is steady."""
        return self.alone(axis, self.held_inputs(axis, command))

    def response(self, axis: Axis, command: float) -> tuple[float, float]:
        """Return the signed V_ss (m/s or rad/s), and Tau (17) from rest in s, in closed form.

        - `axis`: an axis of the vehicle, such as HEAVE; the others are at rest.
        - `command`: a fraction from -1 to 1 of all commands that drive it; positive is its positive direction.

            load_vehicle(SHIPPED["videoray"]).response(HEAVE, 0.3)  # (0.1750, 2.209), as in Table 6
        """
        motion = self.motion_at(axis, command)
        return motion.steady_velocity(), motion.time_constant()


def check_coefficients(layout: Layout, values: Mapping[str, float]) -> None:
    """Raise InputError about the first value that is out of its bounds or belongs to no coefficient of the vehicle."""
    for name, value in values.items():
        if name not in layout.coefficients:
            hint = did_you_mean(name, layout.coefficients) or _by_words(name, layout)
            raise InputError(f"{name}: there is no such coefficient of this vehicle{hint}")
        try:
            within(value, layout.coefficients[name])
        except ValueError as error:
            raise InputError(f"{name} = {shown(value)}: {error}") from error


def _by_words(word: str, layout: Layout) -> str:
    """Return the coefficient that a word describes, as the end of a message: `mass` is m_rov."""
    described = (name for name, of in layout.coefficients.items() if word.lower() in of.description.lower().split())
    return f"; did you mean {name}?" if (name := next(described, "")) else ""


def _number(name: str, value: object) -> float:
    """Return a finite number as a float. Raises InputError."""
    if not isinstance(value, Real) or isinstance(value, bool) or not isfinite(value):
        raise InputError(f"{name} = {shown(value)}: must be a finite number")
    return float(value)


def _contradictions(layout: Layout, coefficients: Mapping[str, float]) -> Iterator[str]:
    """Yield a line for each set of coefficients that are possible alone but not together."""
    for curve in (curve for curve in layout.curves if not curve.tables):
        yield from no_thrust(curve, coefficients, f"curve {curve.name}")
    if layout.has_arm and coefficients["R"] * sin(coefficients["gamma"]) == 0.0:
        yield "R, gamma: must both be more than 0, because R sin γ is the arm of the thrusters"
    yield from check_mass(layout, coefficients)


def without_surface(vehicle: _Vehicle) -> _Vehicle:
    """Return a vehicle that moves everywhere as deep under water."""
    return vehicle.with_(replace(vehicle.layout, surface=False))


def load_vehicle(path: Path, *, coming: Path | None = None) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError, and warns about numbers that are probably wrong.

    - `path`: the file. `find_vehicle("bluerov2")` gives the path of one that ships.
    - `coming`: the path of a report that is about to be written, so it need not exist yet.

        load_vehicle(find_vehicle("videoray"))["m_rov"]  # kg
    """
    path = Path(path)
    return read_vehicle(path, read_bytes(path, VehicleFileError, most=LARGEST), coming=coming)


def read_vehicle(path: Path, content: bytes, *, coming: Path | None = None) -> Vehicle:
    """Return the vehicle that the content of a file with a path describes, as load_vehicle does."""
    data = parse_toml(path, content, VehicleFileError)
    check_keys(path, data, VEHICLE_FILE, VehicleFileError)
    if "format" not in data:
        raise VehicleFileError(f"{path}: format: this key is missing: write format = {FORMAT}")
    if data["format"] != FORMAT:  # the rest of the file may have another meaning
        reason = f"must be {FORMAT}, the only version of the vehicle file"
        raise VehicleFileError(f"{path}: {key_line('format', reason, data['format'])}")
    whole = WholeFile if data.keys().isdisjoint(DRIVING) else DrivenFile
    file, problems, lost = read_tables(data, File, whole, {"folder": path.parent, "coming": coming})
    if mistakes := [*problem_lines(problems, data, File), *check_parts(file, lost, data)]:
        raise VehicleFileError(*lines_on(path, mistakes))
    head, validity = file.vehicle, file.validity
    assert head, "read_tables tells that it is missing"
    assert validity, "read_tables tells that it is missing"
    layout = replace(file.layout, identified=validity.ranges)
    quantities = file.quantities(layout)
    coefficients = {name: q.value if q else UNTUNED for name, q in quantities.items()}
    if mistakes := [*check_mass(layout, coefficients)]:
        raise VehicleFileError(*lines_on(path, mistakes))
    for doubt in doubts(layout, coefficients):
        warnings.warn(one_line(f"{path}: {doubt}"), UserWarning, stacklevel=3)
    vehicle = Vehicle(
        layout,
        coefficients,
        **dict(head),
        basis={
            name: Basis(q.source, q.interval, file.estimates.get(name)) if q else Basis(NOT_GIVEN)
            for name, q in quantities.items()
        },
        command_range=validity.command_range,
        tested=validity.tested,
        stated=validity.stated,
        alternatives=file.alternatives,
        limits=validity.limits,
        provenance=file.provenance,
    )
    warn_of(vehicle, one_line(str(path)))
    return replace(vehicle, file=VehicleFile(path, content, vehicle))


def warn_of(vehicle: Vehicle, name: str) -> None:
    """Warn of a vehicle that is loaded for use, if its own file has doubts about it."""
    if vehicle.doubts:
        warnings.warn(f"{name}: {vehicle.caution}", VehicleWarning, stacklevel=4)
