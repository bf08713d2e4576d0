"""All that is measured in plain C: steps of the VideoRay and the BlueROV2 Heavy, and costs at equal error."""

from collections.abc import Iterator

from rov_fmu.vehicle.vehicle import Vehicle

from .jobs import SOLVERS, SWEEPS, TARGET, Measured, Table
from .page import Section, digits, duration, error
from .plain_c import CORE, FMU, FMU_SET, HEYOKA, RK4, PlainC
from .taylor import NOT_INSTALLED, installed


class Steps:
    """The tables, and the jobs of other methods with ever smaller errors."""

    def __init__(self, rov: Vehicle, heavy: Vehicle, commands: int, known: int) -> None:
        series = [CORE, *([HEYOKA] if installed() else [])]
        self.turning = Table("VideoRay, turning", rov, [CORE, FMU_SET, RK4], commands, known)
        self.straight = Table("VideoRay, straight", rov, [CORE, FMU, RK4], commands, known, straight=True)
        self.one_way = Table("VideoRay, turning one way", rov, series, commands, known, one_way=True)
        self.heavy = Table("BlueROV2 Heavy, six axes and lag", heavy, [CORE, RK4], commands, max(4, known // 4))
        self.sweeps = {method: self.turning.sweep(method, settings) for method, settings in SWEEPS.items()}
        self.ours = self.turning.jobs[CORE, 1.0]

    def measure(self, plain_c: PlainC, heavy_c: PlainC, repetitions: int) -> None:
        """Measure all jobs."""
        tables = (self.turning, self.straight, self.one_way)
        jobs = [job for some in (*(t.jobs.values() for t in tables), *self.sweeps.values()) for job in some]
        self.measured = Measured(plain_c, jobs, repetitions)
        self.measured_heavy = Measured(heavy_c, [*self.heavy.jobs.values()], repetitions)

    def sections(self) -> Iterator[Section]:
        """Yield the tables, and the costs at equal error."""
        for table in (self.turning, self.straight, self.one_way):
            yield table.section(self.measured)
        if HEYOKA not in self.one_way.methods:
            yield [NOT_INSTALLED]
        yield self.heavy.section(self.measured_heavy)
        section = [["ours, to rounding", duration(self.measured.cost(self.ours)), "1"]]
        for method, name in SOLVERS.items():
            cost, times = self.measured.compared(self.sweeps[method], self.ours)
            section.append([name, duration(cost), digits(times)])
        yield [[f"A command of 1 s to {error(TARGET)}", "turning", "times ours"], *section]
