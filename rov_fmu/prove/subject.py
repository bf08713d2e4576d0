"""The FMU that is proved: what it has, and the simulation that the measurements repeat."""

from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from rov_fmu.fmus.description import TIME_LIMIT, budget, read_description
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.fmus.variable import Described
from rov_fmu.io.child_process import ChildProcess
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError
from rov_fmu.io.numbers import TIME_LIMITS, TOLERANCES
from rov_fmu.io.reading import open_file
from rov_fmu.prove.experiments import (
    DEFAULT_STEPS,
    DEFAULT_TOLERANCE,
    MOST_STEPS,
    Experiment,
    NoResultsError,
    read_experiments,
)
from rov_fmu.prove.runs import PlannedRun, Runs

_TOOL = "rov-fmu "
"""The beginning of the generation tool of our FMUs."""


@dataclass(frozen=True)
class Subject(Described):
    """An unpacked FMU, and how it is to be proved."""

    path: Path
    folder: str
    description: Any
    """FMPy's description of the FMU."""
    experiments: list[Experiment]
    """None if the FMU carries no expected results."""
    interface: str | None
    """The name of one of INTERFACES; None for the first of these that the FMU has."""
    tolerance: float | None
    """The relative tolerance of results in place of those of the experiments, or None."""
    time_limit: float

    @property
    def is_ours(self) -> bool:
        """True if this project says that it made the FMU."""
        return str(self.description.generationTool or "").startswith(_TOOL)

    @property
    def obstacle(self) -> str:
        """Why the FMU cannot be run for Co-Simulation in FMI 2.0 or 3.0, or an empty text."""
        if self.description.fmiVersion[:1] not in ("2", "3"):
            return f"it is an FMU of FMI {self.description.fmiVersion}, and this is measured in FMI 2.0 and 3.0"
        if not self.description.coSimulation:
            return "it has no Co-Simulation"
        return "" if self.plan.outputs else "it has no output that is a number"

    def _default(self, key: str) -> float:
        """Return an attribute of the default experiment, or 0 if the FMU does not have it."""
        return float(getattr(self.description.defaultExperiment, key, None) or 0.0)

    @property
    def step(self) -> float:
        """The communication step of the default experiment, s."""
        given, length = self._default("stepSize"), self.plan.length
        return given if length / MOST_STEPS < given <= length else length / DEFAULT_STEPS

    @cached_property
    def experiment(self) -> Experiment | None:
        """The experiment with the most inputs that are held between steps, or None."""
        in_pieces = [x for x in self.experiments if x.stimuli and _pieces(x)]
        return max(in_pieces, key=lambda x: (len(x.stimuli or ()), len(x.references or ())), default=None)

    @property
    def allowed(self) -> float:
        """The relative tolerance of results."""
        own = self.experiment.tolerance if self.experiment else self._default("tolerance")
        return self.tolerance or own or DEFAULT_TOLERANCE

    @cached_property
    def plan(self) -> PlannedRun:
        """The simulation to repeat: an experiment, or the default experiment with the inputs at their start values."""
        outputs = self.numbers("output")
        if experiment := self.experiment:
            return PlannedRun(experiment.start, _pieces(experiment), dict(experiment.parameters), outputs)
        start, stop = self._default("startTime"), self._default("stopTime")
        return PlannedRun(start, ((stop if stop > start else start + 1.0, {}),), {}, outputs)

    @property
    def words(self) -> str:
        """The simulation in words."""
        name = f"experiment {self.experiment.name}" if self.experiment else "default experiment"
        return f"the {name} ({self.plan.length:.3g} s)"

    @contextmanager
    def runs(self, time: float | None = None, kind: type[Runs] = Runs) -> Iterator[ChildProcess]:
        """Yield a child process with the FMU, whose calls are limited in time. Raises ChildError."""
        with closing(ChildProcess(kind, self.folder, limits=budget(time or self.time_limit))) as child:
            yield child


@contextmanager
def opened(
    fmu: Path,
    interface: str | None = None,
    tolerance: float | None = None,
    time_limit: float = TIME_LIMIT,
    *,
    needs_results: bool = False,
) -> Iterator[Subject]:
    """Unpack an FMU of any exporter for a while. Raises FileError, and InputError about a number.

    With `needs_results`, it raises NoResultsError, a FileError, if the FMU carries no expected results.
    """
    import fmpy

    check_suffix(fmu, FMU)
    TIME_LIMITS.checked("time_limit", time_limit)
    if tolerance is not None:
        TOLERANCES.checked("tolerance", tolerance)
    experiments = list[Experiment]()
    with temporary_folder("fmu-") as folder:
        with open_file(fmu) as file:
            unpack_fmu(file, fmu, Path(folder))
        description = read_description(fmu, Path(folder))
        with suppress(*([] if needs_results else [NoResultsError])):
            experiments = read_experiments(fmu, Path(folder), description)
        platforms = fmpy.supported_platforms(folder)
        if fmpy.platform not in platforms:
            raise FileError(
                f"{fmu}: has no binary for this machine ({fmpy.platform}): {', '.join(platforms) or 'none'}"
            )
        yield Subject(fmu, folder, description, experiments, interface, tolerance, time_limit)


def _pieces(experiment: Experiment) -> tuple[tuple[float, Mapping[str, float]], ...]:
    """Return the times up to which the inputs of an experiment are held; none if an input is a ramp."""
    assert experiment.stimuli
    _, *names = experiment.stimuli
    rows = [(time, dict(zip(names, row, strict=True))) for time, *row in zip(*experiment.stimuli.values(), strict=True)]
    pieces = []
    for (before, now), (after, then) in pairwise([*rows, (experiment.stop, rows[-1][1])]):
        end = min(after, experiment.stop)
        if end > max(before, experiment.start):
            if now != then:
                return ()
            pieces.append((end, now))
    return tuple(pieces)
