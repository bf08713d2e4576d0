"""Prove an FMU: run the experiments that it contains with FMPy, and compare the results with the expected ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isnan
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmus.description import TIME_LIMIT
from rov_fmu.fmus.instance import last_message
from rov_fmu.fmus.variable import Variable
from rov_fmu.io.child_process import ChildError, LimitError
from rov_fmu.io.csv_table import Series
from rov_fmu.io.messages import FileError, Progress, ProofError, brief, one_line, silent
from rov_fmu.prove.experiments import Experiment
from rov_fmu.prove.runs import Runs
from rov_fmu.prove.subject import Subject, opened

INTERFACES = {"co-simulation": "coSimulation", "model-exchange": "modelExchange"}
"""FMPy's name of each interface, by the name on the command line."""
_SAME = 1e-9
"""The relative difference below which two times are the same."""
_SHARE_OF_NOMINAL = 0.01
"""The least divisor of a deviation, as a share of the nominal value.

Otherwise the divisor is the largest expected value. FMI recommends the nominal value for absolute tolerances (2.0,
section 2.2.7)."""
_TOLERANCE_OF_SOLVER = 1e-3
"""The share of the tolerance that the solver of Model Exchange may use at each step."""
_LEAST_OF_SOLVER = 1e-7
"""The smallest deviation that counts in Model Exchange, where the errors of the solver's steps add up."""


@dataclass(frozen=True)
class ProofFinding:
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


def prove_fmu(
    fmu: str | Path,
    interface: str | None = None,
    tolerance: float | None = None,
    time_limit: float = TIME_LIMIT,
    on_experiment: Progress = silent,
) -> list[ProofFinding]:
    """Run the experiments of an FMU in a child process and compare the results with the expected ones.

    - `fmu`: an FMU of any exporter with experiments by FMI-LS-REF.
    - `interface`: one of INTERFACES. The default is the first of these that the FMU has.
    - `tolerance`: replaces the tolerances of the experiments, relative to the largest value of a variable. In Model
      Exchange, where a solver integrates, it is at least 1e-7.
    - `time_limit`: the time that each experiment may take, s.
    - `on_experiment`: called before each experiment with its name and the share that is done.

        all(finding.passed for finding in rov_fmu.prove_fmu("videoray.fmu"))

    Raises FileError, and ProofError if the FMU ends its process or exceeds a limit.
    """
    with opened(Path(fmu), interface, tolerance, time_limit, needs_results=True) as subject:
        return compare(subject, on_experiment)


def compare(subject: Subject, on_experiment: Progress = silent) -> list[ProofFinding]:
    """Run the experiments of an FMU and compare the results, as `prove_fmu` does."""
    fmu, wanted = subject.path, subject.interface
    has = [name for name, of in INTERFACES.items() if getattr(subject.description, of)]
    if not has or (wanted and wanted not in has):
        raise FileError(f"{fmu}: has no {wanted or 'interface that can be run'}, only {', '.join(has) or 'none'}")
    chosen = [replace(x, tolerance=subject.tolerance or x.tolerance) for x in subject.experiments]
    experiment, findings = chosen[0], list[ProofFinding]()
    try:
        with subject.runs(kind=_Experiments) as child:
            for n, experiment in enumerate(chosen):
                on_experiment(experiment.name, n / len(chosen))
                findings += child.call("findings", experiment, wanted or has[0])
    except ChildError as error:
        where = one_line(f"{fmu}: experiment {experiment.name!r}")
        raise ProofError(f"{where}: the FMU {error}{remedy(error)}") from error
    return findings


def remedy(error: Exception) -> str:
    """Return how to get more of what an FMU had too little of, to follow the error; an empty text if nothing helps."""
    return "; --time-limit allows more" if isinstance(error, LimitError) and error.limit == "time" else ""


def least_divisor(variable: Variable) -> float:
    """Return the least divisor of a deviation of a variable; without a nominal value, that of 1."""
    return _SHARE_OF_NOMINAL * (abs(variable.nominal) or 1.0)


class _Experiments(Runs):
    """The experiments of an unpacked FMU."""

    def findings(self, experiment: Experiment, interface: str) -> list[ProofFinding]:
        """Run an experiment and compare its results: a finding for each variable, or a single one if it fails."""
        if experiment.references is None:
            return [_failed(experiment, "has no expected results, so nothing is compared")]
        times, *expected = map(np.array, experiment.references.values())
        _, *names = experiment.references
        try:
            result = self._result(experiment, interface, names)
        except Exception as error:  # FMPy raises that itself, and the FMU may fail in any way
            return [_failed(experiment, brief(self.without_folder(error) + last_message(), 240))]
        solved = _LEAST_OF_SOLVER if interface == "model-exchange" else 0.0
        findings = []
        for name, values in zip(names, expected, strict=True):
            scale = max(float(np.abs(values).max()), least_divisor(self.variables[name]))
            off = _deviation(result["time"], result[name], times, values)
            findings.append(ProofFinding(experiment.name, name, off / scale, max(experiment.tolerance, solved)))
        return findings

    def _result(self, experiment: Experiment, interface: str, names: Sequence[str]) -> Any:
        """Run an experiment with FMPy, Model Exchange with a tighter tolerance, and return its table."""
        share = _TOLERANCE_OF_SOLVER if interface == "model-exchange" else 1.0
        return self.simulated(
            start_time=experiment.start,
            stop_time=experiment.stop,
            relative_tolerance=experiment.tolerance * share,
            output_interval=experiment.step,
            fmi_type=interface.title().replace("-", ""),
            start_values=dict(experiment.parameters),
            input=_signals(experiment.stimuli),
            output=names,
            debug_logging=True,
        )


def _failed(experiment: Experiment, reason: str) -> ProofFinding:
    return ProofFinding(experiment.name, "-", inf, experiment.tolerance, reason)


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
    for t, value in zip(at, expected, strict=True):
        there = values[np.abs(times - t) <= _SAME * max(1.0, abs(t))]
        if not there.size:
            there = np.interp([t], times, values, inf, inf)
        off = float(np.min(np.abs(there - value)))
        worst = inf if isnan(off) else max(worst, off)
    return worst
