"""Prove an FMU: run the experiments that it contains with FMPy, and compare the results with the expected ones."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from math import inf, isnan
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmus.description import TIME_LIMIT, budget, read_description
from rov_fmu.fmus.instance import Unpacked, last_message
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.fmus.variable import Variable
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError
from rov_fmu.io.csv_table import Series
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, Progress, ProofError, brief, one_line, silent
from rov_fmu.io.numbers import TIME_LIMITS, TOLERANCES
from rov_fmu.io.reading import open_file
from rov_fmu.prove.experiments import Experiment, read_experiments

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
    import fmpy

    fmu = Path(fmu)
    check_suffix(fmu, FMU)
    TIME_LIMITS.checked("time_limit", time_limit)
    if tolerance is not None:
        TOLERANCES.checked("tolerance", tolerance)
    with temporary_folder("fmu-") as folder:
        with open_file(fmu) as file:
            unpack_fmu(file, fmu, Path(folder))
        description = read_description(fmu, Path(folder))
        experiments = [
            replace(one, tolerance=tolerance or one.tolerance)
            for one in read_experiments(fmu, Path(folder), description)
        ]
        platforms = fmpy.supported_platforms(folder)
        if fmpy.platform not in platforms:
            there = ", ".join(platforms) or "none"
            raise FileError(f"{fmu}: has no binary for this machine ({fmpy.platform}): {there}")
        has = [name for name, of in INTERFACES.items() if getattr(description, of)]
        if not has or (interface and interface not in has):
            what = interface or "interface that can be run"
            raise FileError(f"{fmu}: has no {what}, only {', '.join(has) or 'none'}")
        findings, experiment = list[ProofFinding](), experiments[0]
        try:
            with closing(ChildProcess(_Experiments, folder, limits=budget(time_limit))) as child:
                for n, experiment in enumerate(experiments):
                    on_experiment(experiment.name, n / len(experiments))
                    findings += child.call("findings", experiment, interface or has[0])
        except ChildError as error:
            where = one_line(f"{fmu}: experiment {experiment.name!r}")
            more = "; --time-limit allows more" if isinstance(error, LimitError) and error.limit == "time" else ""
            raise ProofError(f"{where}: the FMU {error}{more}") from error
    return findings


def _least_divisor(variable: Variable) -> float:
    """Return the least divisor of a deviation of a variable; without a nominal value, that of 1."""
    return _SHARE_OF_NOMINAL * (abs(variable.nominal) or 1.0)


class _Experiments(Unpacked):
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
            scale = max(float(np.abs(values).max()), _least_divisor(self.variables[name]))
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
