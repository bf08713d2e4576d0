"""Prove an FMU: run the experiments that it contains with FMPy, and compare the results with the expected ones."""

import io
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, redirect_stdout
from dataclasses import dataclass, replace
from math import inf, isnan
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmu.experiments import Experiment, ReferenceResults
from rov_fmu.fmu.unpacking import unpack_fmu
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError, Limits
from rov_fmu.io.csv_table import Series
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, ProofError, brief, one_line

INTERFACES = {"co-simulation": "coSimulation", "model-exchange": "modelExchange"}
"""FMPy's name of each interface, by the name on the command line."""
_SAME = 1e-9
"""The relative difference below which two times are the same."""
SHARE_OF_NOMINAL = 0.01
"""The least divisor of a deviation, as a share of the nominal value.

Otherwise the divisor is the largest expected value. FMI recommends the nominal value for absolute tolerances (2.0,
section 2.2.7)."""
_TOLERANCE_OF_SOLVER = 1e-3
"""The share of the tolerance that the solver of Model Exchange may use at each step."""
_LEAST_OF_SOLVER = 1e-7
"""The smallest deviation that counts in Model Exchange, where the errors of the solver's steps add up."""
TIME_LIMIT = 60.0
"""The seconds that an FMU may take to be loaded and to run one experiment, if nothing else is given."""
MEMORY, DISK = 4_000_000_000, 1_000_000_000
"""The address space of the process of an FMU and the size of each file that it writes, in bytes (Linux)."""
_WARNING = 1
"""The status `warning` in every version of FMI; more serious ones are greater."""


@dataclass(frozen=True)
class Finding:
    """The result for one variable of an experiment, or for an experiment that fails as a whole."""

    experiment: str
    variable: str
    deviation: float
    """The largest relative deviation."""
    tolerance: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """True when the variable is as expected."""
        return self.deviation <= self.tolerance


def prove(
    fmu: Path,
    interface: str | None = None,
    tolerance: float | None = None,
    time_limit: float = TIME_LIMIT,
    on_experiment: Callable[[str, float], None] = lambda *_: None,
) -> list[Finding]:
    """Run the experiments of an FMU in a child process and compare the results with the expected ones.

    `interface` is one of INTERFACES. The default is the first of these that the FMU has. `tolerance` replaces the
    tolerances of the experiments. In Model Exchange, where a solver integrates, it is at least 1e-7. `time_limit` is
    the time that each experiment may take, s. `on_experiment` is called before each experiment with its name and the
    share that is done.

    Raises FileError, and ProofError if the FMU ends its process or exceeds a limit.
    """
    check_suffix(fmu, FMU)
    reference_results = ReferenceResults(fmu)
    with temporary_folder("fmu-") as folder:
        description = unpack_fmu(fmu, fmu, Path(folder))
        experiments = reference_results.experiments(description)
        check_binary(fmu, folder)
        return compare(fmu, folder, description, experiments, interface, tolerance, time_limit, on_experiment)


def compare(
    fmu: Path,
    folder: str,
    description: Any,
    experiments: Sequence[Experiment],
    interface: str | None = None,
    tolerance: float | None = None,
    time_limit: float = TIME_LIMIT,
    on_experiment: Callable[[str, float], None] = lambda *_: None,
) -> list[Finding]:
    """Run experiments of an FMU that is unpacked in a folder, as `prove` does."""
    has = [name for name, of in INTERFACES.items() if getattr(description, of)]
    if not has or (interface and interface not in has):
        raise FileError(f"{fmu}: has no {interface or 'interface that can be run'}, only {', '.join(has) or 'none'}")
    chosen = [replace(x, tolerance=tolerance or x.tolerance) for x in experiments]
    experiment, findings = chosen[0], list[Finding]()
    limits = Limits(time=time_limit, memory=MEMORY, disk=DISK)
    try:
        with closing(ChildProcess(_Experiments, folder, interface or has[0], limits=limits)) as child:
            for n, experiment in enumerate(chosen):
                on_experiment(experiment.name, n / len(chosen))
                findings += child.call("findings", experiment)
    except ChildError as error:
        where = one_line(f"{fmu}: experiment {experiment.name!r}")
        raise ProofError(f"{where}: the FMU {error}{remedy(error)}") from error
    return findings


def remedy(error: Exception) -> str:
    """Return how to get more of what an FMU had too little of, to follow the error; an empty text if nothing helps."""
    return "; --time-limit allows more" if isinstance(error, LimitError) and error.limit == "time" else ""


def nominal(variable: Any) -> float:
    """Return the size of the nominal value of one of FMPy's variables; 1 if it has none."""
    return abs(float(variable.nominal or 0.0)) or 1.0


def check_binary(fmu: Path, folder: str) -> None:
    """Raise FileError if an unpacked FMU has no binary for this machine."""
    import fmpy

    platforms = fmpy.supported_platforms(folder)
    if fmpy.platform not in platforms:
        raise FileError(f"{fmu}: has no binary for this machine ({fmpy.platform}): {', '.join(platforms) or 'none'}")


class _Experiments:
    """The experiments of an unpacked FMU. A child process runs them, because a damaged FMU may end its process."""

    def __init__(self, folder: str, interface: str) -> None:
        import fmpy

        self._folder, self._interface = folder, interface
        self._description = fmpy.read_model_description(folder, validate=False)

    def findings(self, experiment: Experiment) -> list[Finding]:
        """Run an experiment and compare its results."""
        return list(_findings(self._folder, self._description, self._interface, experiment))


def _findings(folder: str, description: Any, interface: str, experiment: Experiment) -> Iterator[Finding]:
    """Yield a finding for each variable, or a single one if the experiment fails or compares nothing."""
    import fmpy

    if experiment.references is None:
        reason = "has no expected results, so nothing is compared"
        yield Finding(experiment.name, "-", inf, experiment.tolerance, reason)
        return
    times, *expected = map(np.array, experiment.references.values())
    names = [*experiment.references][1:]
    kind = INTERFACES[interface]
    reasons: list[bytes] = []

    def keep(*arguments: Any) -> None:
        """Keep the last warning or error. The last three arguments are the same in every version of FMI."""
        status, _, text = arguments[-3:]
        if status >= _WARNING:
            reasons[:] = [text or b""]

    try:
        with redirect_stdout(io.StringIO()):  # FMPy's warnings
            result = fmpy.simulate_fmu(
                folder,
                validate=False,
                start_time=experiment.start,
                stop_time=experiment.stop,
                relative_tolerance=experiment.tolerance
                * (_TOLERANCE_OF_SOLVER if interface == "model-exchange" else 1.0),
                output_interval=experiment.step,
                fmi_type=kind[0].upper() + kind[1:],
                start_values=dict(experiment.parameters),
                input=_signals(experiment.stimuli),
                output=names,
                model_description=description,
                remote_platform=None,
                debug_logging=True,
                logger=keep,
            )
    except Exception as error:  # FMPy raises that itself, and the FMU may fail in any way
        messages = "".join(f"; the FMU: {text.decode(errors='replace')}" for text in reasons)
        what = str(error).replace(folder + os.sep, "").rstrip(".")  # the cause follows the library's path
        yield Finding(experiment.name, "-", inf, experiment.tolerance, brief(what + messages, 240))
        return
    variables = {v.name: v for v in description.modelVariables}
    for name, values in zip(names, expected, strict=True):
        scale = max(float(np.abs(values).max()), SHARE_OF_NOMINAL * nominal(variables[name]))
        off = _deviation(result["time"], result[name], times, values)
        solved = _LEAST_OF_SOLVER if interface == "model-exchange" else 0.0
        yield Finding(experiment.name, name, off / scale, max(experiment.tolerance, solved))


def _signals(stimuli: Series | None) -> Any:
    """Return the stimuli as the structured array that FMPy takes."""
    if stimuli is None:
        return None
    _, *names = stimuli
    return np.array(list(zip(*stimuli.values(), strict=True)), [(name, np.float64) for name in ("time", *names)])


def _deviation(times: Any, values: Any, at: Any, expected: Any) -> float:
    """Return the largest deviation. At an event, which has two values at one time, the nearer value counts."""
    values = np.asarray(values, dtype=np.float64)
    worst = 0.0
    for t, value in zip(at.tolist(), expected.tolist(), strict=True):
        there = values[np.abs(times - t) <= _SAME * max(1.0, abs(t))]
        if not there.size:
            if not times[0] <= t <= times[-1]:
                return inf
            there = np.interp([t], times, values)
        off = float(np.min(np.abs(there - value)))
        worst = inf if isnan(off) else max(worst, off)
    return worst
