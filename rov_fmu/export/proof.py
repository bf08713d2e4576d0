"""An FMU proved by the experiments that it carries, run by FMPy."""

import io
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from math import inf, isnan
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from rov_fmu.export.experiments import Carried, Experiment, Series
from rov_fmu.files.messages import FileError, brief

INTERFACES = {"co-simulation": "coSimulation", "model-exchange": "modelExchange"}
"""By the name that a person gives: FMPy's."""
_SAME = 1e-9
"""Relative: two times that are one."""
_OF_NOMINAL = 0.01
"""A deviation is relative to the largest expected value, or to this share of the nominal one, which FMI advises for
absolute tolerances (2.0, section 2.2.7)."""
_OF_A_SOLVER = 1e-3
"""What the solver of Model Exchange may take of the tolerance at each step."""


@dataclass(frozen=True)
class Finding:
    """One variable of an experiment, or an experiment that does not end."""

    experiment: str
    variable: str
    deviation: float
    """The largest, relative."""
    tolerance: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """Whether it is as expected."""
        return self.deviation <= self.tolerance


def prove(
    fmu: Path,
    interface: str | None = None,
    tolerance: float | None = None,
    on_experiment: Callable[[str, float], None] = lambda *_: None,
) -> list[Finding]:
    """Run the experiments of an FMU and compare. Raises FileError.

    `interface` is one of INTERFACES; the first that the FMU has by default. A tolerance stands in place of those of the
    experiments. `on_experiment` is told of the one that comes next, and of the share that is done.
    """
    import fmpy

    carried = Carried(fmu)
    with tempfile.TemporaryDirectory(prefix="fmu-", ignore_cleanup_errors=True) as folder:
        try:
            fmpy.extract(str(fmu), unzipdir=folder)
            description = fmpy.read_model_description(folder, validate=False)
            platforms = fmpy.supported_platforms(folder)
        except Exception as error:  # what FMPy raises
            raise FileError(f"{fmu}: is no FMU that FMPy reads: {brief(str(error))}") from error
        experiments = carried.experiments(description)
        if fmpy.platform not in platforms:
            raise FileError(
                f"{fmu}: has no binary for this machine ({fmpy.platform}): {', '.join(platforms) or 'none'}"
            )
        has = [name for name, of in INTERFACES.items() if getattr(description, of)]
        if not has or (interface and interface not in has):
            raise FileError(
                f"{fmu}: has no {interface or 'interface that can be run'}, only {', '.join(has) or 'none'}"
            )
        found: list[Finding] = []
        for n, experiment in enumerate(experiments):
            on_experiment(experiment.name, n / len(experiments))
            chosen = replace(experiment, tolerance=tolerance or experiment.tolerance)
            found += _findings(folder, description, interface or has[0], chosen)
    return found


def _findings(folder: str, description: Any, interface: str, experiment: Experiment) -> Iterator[Finding]:
    """A line a variable, or one where the experiment has no expected results or fails."""
    names = [*(experiment.references or ())][1:]
    kind = INTERFACES[interface]
    said = io.StringIO()
    try:
        with redirect_stdout(said):  # FMPy's warnings, and what the FMU logs
            result = _simulated(
                folder,
                validate=False,
                start_time=experiment.start,
                stop_time=experiment.stop,
                relative_tolerance=experiment.tolerance * (_OF_A_SOLVER if interface == "model-exchange" else 1.0),
                output_interval=experiment.step,
                fmi_type=kind[0].upper() + kind[1:],
                start_values=dict(experiment.parameters),
                input=_signals(experiment.stimuli),
                output=names or None,
                model_description=description,
                remote_platform=None,
            )
    except Exception as error:  # FMPy raises that itself, and the FMU may fail in any way
        yield Finding(experiment.name, "-", inf, experiment.tolerance, brief(str(error)))
        return
    if not experiment.references:
        yield Finding(experiment.name, "-", 0.0, experiment.tolerance)
        return
    times, *expected = experiment.references.values()
    nominal = {v.name: float(v.nominal or 1.0) for v in description.modelVariables}
    for name, values in zip(names, expected, strict=True):
        scale = max(*map(abs, values), _OF_NOMINAL * abs(nominal[name]))
        off = _deviation(result["time"], result[name], times, values)
        yield Finding(experiment.name, name, off / scale, experiment.tolerance)


def _simulated(*arguments: Any, **options: Any) -> Any:
    """What FMPy's simulate_fmu gives, run in a thread of its own: an FMU that hangs keeps no interrupt from coming."""
    import fmpy

    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(fmpy.simulate_fmu(*arguments, **options))
        except BaseException as error:
            future.set_exception(error)

    Thread(target=run, daemon=True).start()
    while not wait([future], timeout=0.1).done:  # on Windows an interrupt comes between two waits
        pass
    return future.result()


def _signals(stimuli: Series | None) -> Any:
    """As FMPy takes them."""
    if stimuli is None:
        return None
    _, *names = stimuli
    return np.array(list(zip(*stimuli.values(), strict=True)), [(name, np.float64) for name in ("time", *names)])


def _deviation(times: Any, values: Any, at: Sequence[float], expected: Sequence[float]) -> float:
    """The largest; at a time that is there twice, before and after an event, from the nearer value."""
    values = np.asarray(values, dtype=np.float64)
    worst = 0.0
    for t, value in zip(at, expected, strict=True):
        there = values[np.abs(times - t) <= _SAME * max(1.0, abs(t))]
        if not there.size:
            if not times[0] <= t <= times[-1]:
                return inf
            there = np.interp([t], times, values)
        off = float(np.min(np.abs(there - value)))
        worst = inf if isnan(off) else max(worst, off)
    return worst
