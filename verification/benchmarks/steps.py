"""All that is measured in plain C: steps of the VideoRay and the BlueROV2 Heavy, costs at equal error, and promises."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rov_fmu.vehicle.vehicle import Vehicle

from .jobs import SOLVERS, STEPS, SUBSTEP, SWEEPS, TARGET, H, Measured, Table
from .page import Section, digits, duration, error
from .plain_c import ADAMS, BDF, CORE, FMU, FMU_3_SET, FMU_SET, HEYOKA, RK4, PlainC
from .taylor import NOT_INSTALLED, installed

FINE = 1e-12
"""The error at which the Heavy is compared with RK4."""
_SHORT = (0.001, SUBSTEP)
_TO_RK4 = {"turning": (1.5, 2.3), "straight": (2.2, 2.8), "heavy": (8.0, 12.0), "rotors": (5.0, 8.0)}
"""The promised largest ratio of a step's cost to RK4's, for the lengths of _SHORT.

All promises are ratios in one run, with a margin for the processor: at 10 ms, a straight step costs 1.9 steps of RK4 on
an AMD EPYC, and 2.5 on an Intel Xeon.
"""
_SETTLES = 25.0
"""The promised smallest ratio of RK4's cost to ours for a straight step of 100 s.

The series take some twenty pieces, half a microsecond each, until the velocities have settled; the rest is in closed
form. Closed forms of the beginning would take less, but only axes that do not act on each other have them.
"""
_TO_OURS = {RK4: 5.0, ADAMS: 8.0, BDF: 18.0}
"""The promised smallest ratio of each method's cost to ours, for a command of 1 s at the error TARGET."""
_TO_HEYOKA = 3.5
"""The promised smallest ratio of heyoka's cost to ours, for the lengths of _SHORT."""


class Steps:
    """The tables, and the jobs of other methods with ever smaller errors."""

    def __init__(self, rov: Vehicle, heavy: Vehicle, commands: int, known: int) -> None:
        series = [CORE, *([HEYOKA] if installed() else [])]
        self.turning = Table("VideoRay, turning", rov, [CORE, FMU_SET, FMU_3_SET, RK4], commands, known)
        self.straight = Table("VideoRay, straight", rov, [CORE, FMU, RK4], commands, known, straight=True)
        self.one_way = Table("VideoRay, turning one way", rov, series, commands, known, one_way=True)
        self.heavy = Table("BlueROV2 Heavy, six axes and lag", heavy, [CORE, RK4], commands, max(4, known // 4))
        curves = tuple(replace(curve, lag="speed") for curve in heavy.layout.curves)
        self.turned = replace(heavy, layout=replace(heavy.layout, curves=curves))
        """The Heavy with rotors that lag in speed."""
        self.rotors = Table("The same with rotors that lag", self.turned, [CORE, RK4], commands, max(4, known // 4))
        self.sweeps = {method: self.turning.sweep(method, settings) for method, settings in SWEEPS.items()}
        self.finer = self.heavy.sweep(RK4, [float(2**n) for n in range(8)], SUBSTEP)
        self.ours = self.turning.jobs[CORE, 1.0]

    def measure(self, plain_c: PlainC, heavy_c: PlainC, rotors_c: PlainC, repetitions: int) -> None:
        """Measure all jobs."""
        tables = (self.turning, self.straight, self.one_way)
        jobs = [job for some in (*(t.jobs.values() for t in tables), *self.sweeps.values()) for job in some]
        self.measured = Measured(plain_c, jobs, repetitions)
        self.measured_heavy = Measured(heavy_c, [*self.heavy.jobs.values(), *self.finer], repetitions)
        self.measured_rotors = Measured(rotors_c, [*self.rotors.jobs.values()], repetitions)

    def sections(self) -> Iterator[Section]:
        """Yield the tables, the costs at equal error, and what is promised."""
        for table in (self.turning, self.straight, self.one_way):
            yield table.section(self.measured)
        if HEYOKA not in self.one_way.methods:
            yield [NOT_INSTALLED]
        yield self.heavy.section(self.measured_heavy)
        yield self.rotors.section(self.measured_rotors)
        section = [["ours, to rounding", duration(self.measured.cost(self.ours)), "1"]]
        for method, name in SOLVERS.items():
            cost, times = self.measured.compared(self.sweeps[method], self.ours)
            section.append([name, duration(cost), digits(times)])
        yield [[f"A command of 1 s to {error(TARGET)}", "turning", "times ours"], *section]
        yield self._promises()

    def _promises(self) -> Section:
        """Return the promises with what is measured. Ratios and differences are medians over the repetitions."""
        tables = (self.turning, self.straight, self.heavy, self.rotors, self.one_way)
        turning, straight, heavy, rotors, one_way = (table.jobs for table in tables)
        m, slow, turned = self.measured, self.measured_heavy, self.measured_rotors
        found: list[tuple[str, float, str, float]] = []
        to_rk4 = ((turning, m), (straight, m), (heavy, slow), (rotors, turned))
        for (name, limits), (jobs, by) in zip(_TO_RK4.items(), to_rk4, strict=True):
            ratios = [by.ratio(jobs[CORE, h], jobs[RK4, h]) for h in _SHORT]
            found += [
                (f"{name} step to one of RK4, {1000 * h:g} ms", ratio, "≤", limit)
                for h, ratio, limit in zip(_SHORT, ratios, limits, strict=True)
            ]
        with_fmi = m.ratio(turning[FMU_SET, SUBSTEP], turning[RK4, SUBSTEP])
        worst = max(m.error(jobs[CORE, h]) for jobs in (turning, straight) for h in (SUBSTEP, 1.0))
        layer = float(np.median(m.seconds[straight[FMU, SUBSTEP]] - m.seconds[straight[CORE, SUBSTEP]]))
        settles = m.ratio(straight[RK4, 100.0], straight[CORE, 100.0])
        found += [
            ("turning, with fmi2SetReal and fmi2DoStep, to RK4, 10 ms", with_fmi, "≤", 2.5),
            ("its error after 1 s, in steps of 10 ms and 1 s", worst, "≤", 1e-13),
            ("RK4 to ours, straight step of 100 s", settles, "≥", _SETTLES),
            ("what FMI adds to a step of 10 ms, ns", 1e9 * layer, "≤", 20.0),
            (f"RK4 to ours of the Heavy, to {error(FINE)}", self._finer(), "≥", 2.0),
        ]
        for method, limit in _TO_OURS.items():
            times = m.compared(self.sweeps[method], self.ours)[1]
            found.append((f"{SOLVERS[method]} to ours, at {error(TARGET)} a command of 1 s", times, "≥", limit))
        for h, step in zip(H, STEPS, strict=True):
            ratio = m.ratio(turning[FMU_3_SET, h], turning[FMU_SET, h])
            found.append((f"turning, set and step, FMI 3.0 to FMI 2.0, {step}", ratio, "≤", 1.05))
        for h in _SHORT if HEYOKA in self.one_way.methods else ():
            times = m.ratio(one_way[HEYOKA, h], one_way[CORE, h])
            found.append((f"heyoka to ours, turning, {1000 * h:g} ms", times, "≥", _TO_HEYOKA))
        rows = []
        for what, value, sign, limit in found:
            is_kept = value <= limit if sign == "≤" else value >= limit
            rows.append([what, f"{value:.3g}", f"{sign} {limit:g}", "kept" if is_kept else "NOT KEPT"])
        return [["Promised", "measured", "promised", ""], *rows]

    def _finer(self) -> float:
        return self.measured_heavy.compared(self.finer, self.heavy.jobs[CORE, SUBSTEP], FINE)[1]
