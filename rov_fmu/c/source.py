"""The equation of motion of a vehicle in C: the files model.h and equation.h, generated from its table of terms."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby

from rov_fmu.c.compile import C_SOURCES
from rov_fmu.c.products import Products
from rov_fmu.equation.alone import response_formulas
from rov_fmu.equation.attitude import QUATERNION, TURN, entry, start_formulas
from rov_fmu.equation.catalogue import rate_name
from rov_fmu.equation.expression import (
    PYTHON,
    ZERO,
    Expression,
    Name,
    change_of,
    tangent,
    tangents,
    to_c,
    total,
    written,
)
from rov_fmu.equation.forces import AT_SURFACE, above
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import Equation, Term, equation_of, rate_formula
from rov_fmu.io.groups import grouped


class EquationSource:
    """The parts of model.h and equation.h in C."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.equation: Equation = equation_of(layout)
        self.variables = frozenset(layout.places)
        dynamic = self.equation.dynamic
        assert self.equation.components[: len(dynamic)] == dynamic, "the C code knows only the number of these"

    # ---- Names ----

    @cached_property
    def places(self) -> dict[str, int]:
        """The places of the variables without those of the rates of the states."""
        rates = {*map(rate_name, self.layout.state)}
        return {name: place for name, place in self.layout.places.items() if name not in rates}

    @cached_property
    def unloaded(self) -> "EquationSource":
        """The parts of the equation while the loads in the earth frame are 0."""
        source = EquationSource(self.layout)
        source.equation = self.equation.unloaded
        return source

    @cached_property
    def _in_c(self) -> dict[str, str]:
        """The C expression for every name that a formula may contain."""
        equation = self.equation
        in_c = {name: f"at[REF_{name}]" for name in self.places}
        in_c |= {name: f"n->{name}" for name in equation.parameters}
        in_c |= {name: f"q->{name}" for name in self.piece_names()}
        return in_c | {state: f"y[Y_{state}]" for state in equation.states if state not in self.variables}

    def piece_names(self) -> list[str]:
        """Return the names of the numbers that are constant during a piece of a step."""
        equation = self.equation
        later = [*equation.forces.values(), *equation.outputs.values()]
        later += [formula for both in equation.lagging.values() for formula in both]
        later += [formula for lag in equation.lags for formula in lag.reversals]
        used = frozenset(self.layout.calculated).union(*(formula.names for formula in later))
        lasting = [name for name in equation.thrust if name in used]
        return [*equation.directed, *lasting, *equation.lagging, *equation.forces]

    # ---- Coefficients ----

    def parameters(self) -> list[str]:
        """Return statements that compute the numbers that follow from the coefficients alone."""
        directed = self.equation.directed.items()
        sides = {f"{name}[{n}]": side for name, one in directed for n, side in enumerate(one.args[1:])}
        formulas = {**self.equation.parameters, **sides}
        return _statements(formulas, {name: f"n->{name}" for name in formulas}, self._in_c)

    def thrust(self) -> list[str]:
        """Return statements that compute the steady thrust."""
        of_piece = {name: f"q->{name}" for name in self.piece_names()}
        return _statements(_needed(self.equation.thrust, map(Name, of_piece)), of_piece, self._in_c)

    def forces(self) -> list[str]:
        """Return statements that compute the torques and accelerations that are constant while the inputs are held."""
        return _statements(self.equation.forces, self._in_c, self._in_c)

    def starts(self) -> list[str]:
        """Return statements that set the states of the table at the start of a step."""
        starts, states = self.equation.starts, self.equation.states
        local = {name: formula for name, formula in starts.items() if name not in states}
        # a change of the current turns with the orientation, so that the velocities come after it
        order = sorted(states, key=lambda name: bool(self.layout.before) and name in self.layout.velocities)
        first = {name: starts.get(name, ZERO) for name in order}
        return _statements({**local, **first}, {name: f"y[Y_{name}]" for name in states}, self._in_c)

    def at_start(self, name: str) -> str:
        """Write a monitored state in terms of the vehicle's variables."""
        return self.in_c(self.equation.shifted.get(name, Name(name)))

    def in_c(self, formula: Expression) -> str:
        """Write a formula in C."""
        return to_c(formula, self._in_c.__getitem__)

    def coasting(self) -> list[str]:
        """Return the integrals whose rates are constant while all velocities are steady.

        These are all integrals except the x and y of a vehicle that has a heading. With an attitude there are none.
        """
        if self.layout.has_attitude:
            return []
        turning = {name for name, others in self.equation.states_in_rate.items() if not others.isdisjoint(TURN)}
        return [name for name in self.equation.states if name not in self.equation.used | turning]

    def turning(self) -> list[str]:
        """Return the entries of the rotation matrix that still change while all velocities are steady."""
        kinematic = self.equation.components[len(self.equation.dynamic) :]
        rotating = {name for group in kinematic for name in group} & {*self.equation.orientation}
        return [name for name in self.equation.states if name in rotating] if self.layout.has_attitude else []

    def attitude(self) -> list[str]:
        """Return statements that set the quaternion to that of the rotation matrix in y."""
        places = {name: f"state[REF_{name} - FIRST_STATE]" for name in QUATERNION}
        known = places | {entry: f"y[Y_{entry}]" for entry in self.equation.orientation}
        after: dict[str, Expression] = {name: Name(f"next_{name}") for name in QUATERNION}
        return _statements({**self.equation.ends, **after}, places, known)

    def rotation(self) -> list[str]:
        """Return statements that set the rotation matrix in y to that of the quaternion."""
        entries = [name for name in self.equation.states if name in self.equation.orientation]
        return self._results({f"y[Y_{name}]": Name(name) for name in entries})

    # ---- Rates and terms ----

    def rate(self, name: str) -> str:
        """Write the rate of a state in terms of the states y of the table."""
        return self.by_states(rate_formula(self.terms(name)))

    def size(self, name: str, above: bool = False) -> str:
        """Write the sum of the sizes of the terms in the rate of a state."""
        sizes = (f"fabs({self.by_states(rate_formula([term]))})" for term in self.terms(name, above))
        return " + ".join(sizes) or "0.0"

    def terms(self, name: str, above: bool = False) -> list[Term]:
        """Return the terms in the rate of a state: those that there always are, or those above the surface alone."""
        return [term for term in self.equation.rows[name] if (term.effect is AT_SURFACE) == above]

    def above(self, names: Iterable[str] = ()) -> dict[str, str]:
        """Return the states, of some or of all, whose rates have terms above the surface, with these as formulas."""
        own = {name: self.terms(name, above=True) for name in names or self.equation.states}
        return {name: self.by_states(rate_formula(terms)) for name, terms in own.items() if terms}

    @property
    def beyond(self) -> str:
        """The coefficient that is not 0 above the surface."""
        return self.equation.names("beyond", next(iter(above(self.layout)))).identifier

    def by_states(self, formula: Expression) -> str:
        """Write a formula in C in which every state is taken from y, and not from `at`."""
        known = {**self._in_c, **{state: f"y[Y_{state}]" for state in self.equation.states}}
        return to_c(formula, known.__getitem__)

    def alone(self, velocity: str, number: int) -> list[str]:
        """Return statements that compute V_ss and Tau of an axis alone."""
        places = {"V_ss": f"marks[{number}][0]", "Tau": f"marks[{number}][1]"}
        return _statements(_needed(response_formulas(self.layout, velocity), map(Name, places)), places, self._in_c)

    @cached_property
    def blocks(self) -> list[tuple[str, ...]]:
        """The blocks: groups of neighbouring states whose Taylor coefficients are computed together.

        No block depends on a later one.
        """
        depth: dict[str, int] = {}
        used = self.equation.used
        for group in self.equation.components:
            below = {factor for name in group for term in self.terms(name) for factor in term.factors}  # the surface
            level = 1 + max((depth[name] for name in below - set(group)), default=0)
            last = 1 + len(self.equation.components)
            depth |= dict.fromkeys(group, level if used & set(group) else last)
        blocks = []
        for level in sorted(set(depth.values())):
            neighbours = groupby(self.equation.states, key=lambda name: depth[name] == level)
            blocks += [tuple(names) for is_level, names in neighbours if is_level]
        return blocks

    @cached_property
    def block_of(self) -> dict[str, int]:
        """The index of the block of each state."""
        return {name: i for i, block in enumerate(self.blocks) for name in block}

    def products(self, block: Sequence[str], above: bool = False) -> Products:
        """Return the products of two states in the rates of a block."""
        pairs = (term.factors for name in block for term in self.terms(name, above) if len(term.factors) == 2)
        return Products(self.equation.states, self.block_of, pairs)

    def next_term(self, name: str, places: Mapping[tuple[str, ...], str], above: bool = False) -> str:
        """Write coefficient m > 0 of the rate of a state. `places` are the C expressions of the products."""
        parts = []
        for term in self.terms(name, above):
            if term.factors:  # a constant occurs in coefficient 0 only
                state = f"c[m][Y_{term.factors[0]}]" if len(term.factors) == 1 else places[term.factors]
                parts.append(replace(term, factors=(state,)).formula)
        known = self._in_c
        return to_c(total(parts), lambda name: known.get(name, name))

    @cached_property
    def component_of(self) -> dict[str, int]:
        """The index of the component of each state."""
        return {name: i for i, group in enumerate(self.equation.components) for name in group}

    def _inputs(self, group: Sequence[str]) -> set[str]:
        """Return the states outside a group that the rates of its states depend on."""
        return {other for name in group for other in self.equation.states_in_rate[name]} - set(group)

    def input_bits(self, group: Sequence[str]) -> int:
        """Return one bit for each other component that a component depends on."""
        return sum(1 << other for other in {self.component_of[name] for name in self._inputs(group)})

    def needed_with(self, group: Sequence[str]) -> int:
        """Return the bit mask of the states that multiply a component in other rows; all ones mean "never skip".

        A component may be skipped while every such state is 0, as the heading of a vehicle that stands still.
        """
        always, partners = 2**64 - 1, 0
        needed = {*self.equation.monitored, *(self.equation.orientation if self.layout.has_attitude else ())}
        if self.equation.used.isdisjoint(group) or not needed.isdisjoint(group):
            return always
        for name in set(self.equation.states) - set(group):
            for factors in (term.factors for term in self.equation.rows[name] if set(term.factors) & set(group)):
                others = set(factors) - set(group)
                if not others:
                    return always
                partners |= sum(1 << self.equation.states.index(other) for other in others)
        return partners

    @cached_property
    def groups(self) -> dict[str, list[str]]:
        """The states whose rounding errors are compared with their common size, by the first of them.

        They are the cosine and the sine of the heading, and the horizontal position; with an attitude, each row of the
        rotation matrix, and the position. A depth that is in a term is a group of its own.
        """
        has_depth = self.layout.has_attitude and "z" not in self.equation.used
        first = {"sin_psi": "cos_psi", "y": "x"} | ({"z": "x"} if has_depth else {})
        first |= {entry(row, column): entry(row, 1) for row in (1, 2, 3) for column in (1, 2, 3)}
        return grouped((first.get(name, name), name) for name in self.equation.states)

    # ---- Derivatives of the vehicle's states ----

    def derivative_lines(self) -> list[str]:
        """Return statements that assign the derivatives. Before them, the directions must have been chosen in `q`."""
        return self._results({f"at[REF_{name} + N_STATES]": self.equation.rates[name] for name in self.layout.state})

    def output_lines(self) -> list[str]:
        """Return statements that assign the outputs that follow from the states."""
        outputs = self.equation.outputs
        formulas = {**_needed(self.equation.orientation, outputs.values()), **outputs}
        places = {name: f"at[REF_{name}]" for name in outputs if name in self.places}
        return _statements(formulas, places, self._in_c)

    def _results(self, formulas: Mapping[str, Expression]) -> list[str]:
        """Return statements that assign results. Before them come the parts of the orientation that they contain."""
        return _assigned({**self.equation.orientation, **self.equation.shifted}, formulas, self._in_c)

    def beginning(self) -> list[str]:
        """Return statements that compute the attitude at the start from its parameters."""
        formulas = start_formulas() if self.layout.has_attitude else {}
        return _statements(formulas, {name: f"at[REF_{name}]" for name in self.layout.state}, self._in_c)

    def beginning_tangent(self) -> list[str]:
        """Return statements that add the changes of the attitude at the start to d."""
        if not self.layout.has_attitude:
            return []
        steps, changes = tangents(start_formulas(), self.layout.initial)
        states = [name for name in self.layout.state if name in changes]
        results = {f"d[REF_{name}]": Name(f"d[REF_{name}]") + changes[name] for name in states}
        return _assigned(steps, results, {**_with_changes(self.layout.initial), **{place: place for place in results}})

    def tangent_lines(self) -> list[str]:
        """Return statements that write the changes of the calculated variables to d.

        Before, d has the changes of all other variables.
        """
        given = self.variables - {*self.layout.calculated}
        steps, changes = tangents({**self.equation.program, **self.equation.outputs}, given)
        calculated = [name for name in self.layout.calculated if name in changes]
        results: dict[str, Expression] = {f"d[REF_{name}]": changes[name] for name in calculated}
        for name in self.layout.state:
            results[f"d[REF_{name} + N_STATES]"] = tangent(self.equation.rates[name], changes)
        return _assigned(steps, results, _with_changes(given))


def _assigned(
    steps: Mapping[str, Expression], results: Mapping[str, Expression], known: Mapping[str, str]
) -> list[str]:
    """Return statements that assign results to their places. Before them come the steps that they need."""
    formulas = {**_needed(steps, results.values()), **results}
    return _statements(formulas, {place: place for place in results}, known)


def _statements(formulas: Mapping[str, Expression], places: Mapping[str, str], known: Mapping[str, str]) -> list[str]:
    """Return statements in C. Formulas with a place are assigned to it, and the others are local constants.

    `known` has the C expressions of the names that the formulas contain, besides the local constants.
    """
    in_c = {**known, **{name: name for name in formulas if name not in places}}
    left = {name: places.get(name, f"const real {name}") for name in formulas}
    return [f"{left[name]} = {to_c(formula, in_c.__getitem__)};" for name, formula in formulas.items()]


def _with_changes(variables: Iterable[str]) -> dict[str, str]:
    """Return the C expressions of variables and of their changes, by their names."""
    places = {name: f"at[REF_{name}]" for name in variables}
    return places | {change_of(name).identifier: f"d[REF_{name}]" for name in variables}


def _needed(formulas: Mapping[str, Expression], wanted: Iterable[Expression]) -> dict[str, Expression]:
    """Return the formulas that some expressions need, in their order."""
    needed = set().union(*(formula.names for formula in wanted))
    for name in reversed(list(formulas)):
        if name in needed:
            needed |= formulas[name].names
    return {name: formula for name, formula in formulas.items() if name in needed}


def generated_sources(layout: Layout) -> dict[str, str]:
    """Return the generated files of a vehicle, model.h and equation.h, by their names."""
    source = EquationSource(layout)
    formulas = {name: written(rate_formula(terms), PYTHON) for name, terms in source.equation.rows.items()}
    given = {"source": source, "equation": source.equation, "formulas": formulas, "quaternion": QUATERNION}
    from rov_fmu.io.templates import render  # imports Jinja2, which commands that generate no C do not need

    return {name: render(f"{name}.j2", **given) for name in ("model.h", "equation.h")}


def unused_sources(layout: Layout) -> list[str]:
    """Return the shared C files that a vehicle does not need."""
    needed = {
        "heading.c": layout.has_attitude,
        "delay.c": layout.has_dead_time,
        "lag.c": bool(layout.lagging),
        "table.c": bool(equation_of(layout).tables),
    }
    return [name for name, is_needed in needed.items() if not is_needed]


def c_sources(layout: Layout) -> dict[str, str]:
    """Return the C files of a vehicle's motion by their names: the generated and the shared ones."""
    names = {"real.h", "series.c", "step.c", "coast.c", "heading.c", "delay.c", "lag.c", "table.c"}
    used = sorted(names - {*unused_sources(layout)})
    shared = {name: (C_SOURCES / name).read_text(encoding="utf-8") for name in used}
    return generated_sources(layout) | shared


def sampled_sources() -> dict[str, str]:
    """Return the C files that models have in common which sample their inputs once per step, by their names."""
    sampled = (C_SOURCES / "sampled.c").read_text(encoding="utf-8")
    return {"sampled.c": sampled, "series.c": "/* What samples its inputs has no series. */\n"}
