"""The equation of motion of a vehicle in C: model.h and equation.h, generated from its table of terms."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from checks.terms.equation import Equation, Term, equation_of, rate_formula
from checks.terms.formula import names, tangent, to_c
from rov_fmu.export.interface import variables
from rov_fmu.files.templates import render
from rov_fmu.motion.layout import Layout
from rov_fmu.motion.rov import Rov


class EquationSource:
    """The parts of equation.h: lines of C by what they compute. `variables` are the names of the FMU's variables."""

    def __init__(self, layout: Layout, variables: Iterable[str]) -> None:
        self.layout = layout
        self.equation: Equation = equation_of(layout)
        self.variables = frozenset(variables)

    # ---- Names ----

    def _in_c(self, local: Iterable[str] = ()) -> dict[str, str]:
        """Return the C expression of every name that a formula may contain, with names of local constants."""
        equation = self.equation
        found = {name: f"at[REF_{name}]" for name in self.variables}
        found |= {name: f"n->{name}" for name in equation.parameters}
        found |= {name: f"q->{name}" for name in self.held_names()}
        found |= {state: f"y[Y_{state}]" for state in equation.states if state not in self.variables}
        return found | {name: name for name in local}

    def _c(self, formula: str, local: Iterable[str] = ()) -> str:
        known = self._in_c(local)
        return to_c(formula, lambda name: known[name])

    def held_names(self) -> list[str]:
        """Return the names of what is held during a piece of a step."""
        lasting = [name for name in self.equation.thrust if name.startswith(("steady_", "F_"))]
        return [*self.equation.directed, *lasting, *self.equation.lagging, *self.equation.forces]

    # ---- Coefficients ----

    def parameters(self) -> list[str]:
        """Assign what follows from the parameters."""
        lines = [f"n->{name} = {self._c(formula)};" for name, formula in self.equation.parameters.items()]
        for name, directed in self.equation.directed.items():
            lines += [f"n->{name}[0] = {self._c(directed.forward)};", f"n->{name}[1] = {self._c(directed.reverse)};"]
        return lines

    def thrust(self) -> list[str]:
        """Compute the steady thrust."""
        lines: list[str] = []
        local: list[str] = []
        held = self.held_names()
        for name, formula in self.equation.thrust.items():
            text = self._c(formula, local)
            if name in held:
                lines.append(f"q->{name} = {text};")
            else:
                local.append(name)
                lines.append(f"const double {name} = {text};")
        return lines

    def forces(self) -> list[str]:
        """Compute what is held, from the forces of the thrusters."""
        return [f"q->{name} = {self._c(formula)};" for name, formula in self.equation.forces.items()]

    def directions(self) -> list[tuple[str, int]]:
        """Return each coefficient that depends on a direction, with the place of its velocity among the monitored."""
        return [(name, self.equation.monitored.index(d.velocity)) for name, d in self.equation.directed.items()]

    def starts(self) -> list[str]:
        """Set the states of the table."""
        starts = self.equation.starts
        return [f"y[Y_{name}] = {self._c(starts[name]) if name in starts else '0.0'};" for name in self.equation.states]

    def lag_settled(self) -> list[tuple[str, list[str]]]:
        """For each curve with lag, the names of its thrusters."""
        return [
            (c.name, [t.name for t in self.layout.thrusters if t.curve == c.name])
            for c in self.layout.curves
            if c.has_lag
        ]

    def coasting(self) -> list[str]:
        """Statements for the integrals while all velocities are steady, by their rates; x and y are not among them."""
        return [name for name in self.equation.states if not self.used(name) and not self.turns(name)]

    def turns(self, name: str) -> bool:
        """Tell whether the rate of a state depends on the heading."""
        return "cos_psi" in self.equation.inputs_of[name] or "sin_psi" in self.equation.inputs_of[name]

    def group(self, name: str) -> str:
        """The first state of the group whose sizes count together: the heading's, and the horizontal position's."""
        return {"sin_psi": "cos_psi", "y": "x"}.get(name, name)

    def dynamic(self) -> int:
        """The number of components that are not kinematic; they come first."""
        kinematic = {"cos_psi", "sin_psi", "x", "y", "z", "psi"}
        return sum(not kinematic & set(group) for group in self.equation.components)

    def finish(self) -> list[str]:
        """The vehicle's states after a step."""
        lines = []
        for name in self.layout.state:
            if name in self.equation.lagging:
                end = f"q->{name}"
            elif self.used(name):
                end = f"y[Y_{name}]"
            else:
                end = f"state[REF_{name} - FIRST_STATE] + gone[Y_{name}]"
            lines.append(f"next[REF_{name} - FIRST_STATE] = {end};")
        return lines

    # ---- Rates and terms ----

    def rate(self, name: str) -> str:
        """The rate of a state from the states y."""
        return self._rate(self.equation.rows[name])

    def size(self, name: str) -> str:
        """The sum of the sizes of its terms."""
        return " + ".join(f"fabs({self._rate([term])})" for term in self.equation.rows[name])

    def _rate(self, terms: Sequence[Term]) -> str:
        known = {**self._in_c(), **{state: f"y[Y_{state}]" for state in self.equation.states}}
        return to_c(rate_formula(terms), lambda name: known[name])

    def blocks(self) -> list[tuple[str, ...]]:
        """Return the states in groups whose coefficients are computed together: none depends on a later group."""
        depth: dict[str, int] = {}
        for group in self.equation.components:
            inputs = {other for name in group for other in self.equation.inputs_of[name]} - set(group)
            level = 1 + max((depth[name] for name in inputs), default=0)
            last = 1 + len(self.equation.components)
            depth |= dict.fromkeys(group, level if any(map(self.used, group)) else last)
        levels = sorted(set(depth.values()))
        return [tuple(name for name in self.equation.states if depth[name] == level) for level in levels]

    def block_of(self, name: str) -> int:
        """Return the place of a state's block."""
        return next(i for i, block in enumerate(self.blocks()) if name in block)

    def products(self, block: Sequence[str]) -> tuple[list[tuple[str, str, int]], dict[tuple[str, str], str]]:
        """Return the products of a block as runs over neighbouring states, and where each product stands in C.

        A run is (first factor, first of the second factors, length); the first factor is "" for squares.
        """
        states = self.equation.states
        pairs = {term.factors for name in block for term in self.equation.rows[name] if len(term.factors) == 2}
        wanted = {("", a) if a == b else (a, b) for a, b in pairs}
        runs: list[tuple[str, str, int]] = []
        places: dict[tuple[str, str], str] = {}
        while wanted:
            candidates = {*wanted, *((b, a) for a, b in wanted if a)}
            best: tuple[str, str, int] = ("", "", 0)
            for first, second in sorted(candidates, key=lambda pair: (pair[0], states.index(pair[1]))):
                place, length = states.index(second), 0
                while place + length < len(states) and (first, states[place + length]) in candidates:
                    length += 1
                if length > best[2]:
                    best = first, second, length
            first, second, length = best
            for lane in range(length):
                other = states[states.index(second) + lane]
                places[first or other, other] = places[other, first or other] = f"p{len(runs)}[{lane}]"
                wanted -= {(first, other), (other, first)}
            runs.append(best)
        return runs, places

    def next_term(self, name: str, places: Mapping[tuple[str, str], str]) -> str:
        """The sum in coefficient m + 1 of a state's series, m > 0, before the division."""
        parts = []
        for term in self.equation.rows[name]:
            if not term.factors:
                continue
            factors = (
                f"c[m][Y_{term.factors[0]}]" if len(term.factors) == 1 else places[term.factors[0], term.factors[1]]
            )
            sign, coefficient = (
                ("-", term.coefficient[1:]) if term.coefficient.startswith("-") else ("", term.coefficient)
            )
            parts.append((sign, factors if coefficient == "1" else f"{self._c(coefficient)} * {factors}"))
        if not parts:
            return "0.0"
        first = parts[0][0] + parts[0][1]
        return first + "".join(f" {sign or '+'} {text}" for sign, text in parts[1:])

    def component_of(self, name: str) -> int:
        """Return the place of a state's component."""
        return next(i for i, group in enumerate(self.equation.components) if name in group)

    def inputs_of(self, group: Sequence[str]) -> list[int]:
        """Return the other components that a component depends on."""
        inputs = {other for name in group for other in self.equation.inputs_of[name]} - set(group)
        return sorted({self.component_of(name) for name in inputs})

    def input_bits(self, group: Sequence[str]) -> int:
        """Return the other components that a component depends on, a bit each."""
        return sum(1 << other for other in self.inputs_of(group))

    def used(self, name: str) -> bool:
        """Tell whether a term contains a state."""
        return any(name in inputs for inputs in self.equation.inputs_of.values())

    def is_integral(self, name: str) -> bool:
        """Tell whether a state is only the integral of another one: its series converges where that one's does."""
        return not self.used(name) and all(len(term.factors) < 2 for term in self.equation.rows[name])

    def lagging_ends(self) -> list[tuple[str, str]]:
        """The force of each thruster with lag after a piece, with y at its end."""
        known = {**self._in_c(), **{state: f"y[Y_{state}]" for state in self.equation.states}}
        return [(name, to_c(end, lambda n: known[n])) for name, (_, end) in self.equation.lagging.items()]

    # ---- Derivatives of the vehicle's states ----

    def derivative_lines(self) -> list[str]:
        """Assign the derivatives; the coefficients that depend on a direction stand in `q`."""
        equation = self.equation
        known = self._in_c(equation.heading)
        lines = [f"const double {name} = {self._c(formula)};" for name, formula in equation.heading.items()]
        for name in self.layout.state:
            lines.append(f"at[REF_{name} + N_STATES] = {to_c(equation.rates[name], lambda n: known[n])};")
        return lines

    def tangent_lines(self) -> list[str]:
        """Compute the change of what is calculated, for changes d of inputs, states and coefficients, into d."""
        equation = self.equation
        given = self.variables - {*self.layout.thrust}
        text = {name: f"at[REF_{name}]" for name in given}
        text |= {f"d_{name}": f"d[REF_{name}]" for name in given}
        steps: dict[str, str] = {}

        def change_of(name: str) -> str | None:
            return f"d_{name}" if name in given or f"d_{name}" in steps else None

        for name, formula in equation.program.items():
            steps[name] = formula
            if change := tangent(formula, change_of):
                steps[f"d_{name}"] = change
        results = {f"d[REF_{name}]": f"d_{name}" for name in self.layout.thrust if f"d_{name}" in steps}
        for name in self.layout.state:
            results[f"d[REF_{name} + N_STATES]"] = tangent(equation.rates[name], change_of) or "0"
        needed = {name for formula in results.values() for name in names(formula)}
        for name in reversed(steps):
            if name in needed:
                needed |= {*names(steps[name])}
        text |= {name: name for name in steps}
        lines = [f"const double {name} = {to_c(steps[name], lambda n: text[n])};" for name in steps if name in needed]
        return lines + [f"{place} = {to_c(formula, lambda n: text[n])};" for place, formula in results.items()]


def sources(rov: Rov) -> dict[str, str]:
    """Return the C files of a vehicle's motion by their names: generated ones, and those that all vehicles share."""
    folder = Path(__file__).parent
    layout = rov.layout
    names = {v.name: v.value_reference for v in variables(rov) if not v.derivative_of}
    source = EquationSource(layout, names)
    formulas = {name: rate_formula(terms) for name, terms in source.equation.rows.items()}
    sizes = {"inputs": len(layout.inputs), "commands": len(layout.commands), "states": len(layout.state),
             "thrust": len(layout.thrust), "coefficients": len(layout.coefficients)}  # fmt: skip
    given = {"names": names, "source": source, "equation": source.equation, "formulas": formulas, "n": sizes}
    files = {name: render(f"{name}.j2", folder, **given) for name in ("model.h", "equation.h")}
    return files | {name: (folder / name).read_text(encoding="utf-8") for name in ("series.c", "step.c")}
