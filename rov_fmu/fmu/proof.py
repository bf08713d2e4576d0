"""Prove an FMU: run the experiments that it contains with FMPy, and compare the results with the expected ones."""

import io
import os
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, redirect_stdout
from dataclasses import dataclass, replace
from math import inf, isnan
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmu.experiments import Experiment, ReferenceResults
from rov_fmu.fmu.unpacking import unpack_fmu
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.interrupts import UNINTERRUPTED, ctrl_c_withheld, temporary_folder
from rov_fmu.io.messages import FileError, ProofError, brief, one_line
from rov_fmu.io.time_series import Series

INTERFACES = {"co-simulation": "coSimulation", "model-exchange": "modelExchange"}
"""FMPy's names of the interfaces, by the names of the command line."""
_TIME_TOLERANCE = 1e-9
"""The relative difference up to which two times are the same."""
_SHARE_OF_NOMINAL = 0.01
"""A deviation is relative to the largest expected value or to this share of the nominal value, whichever is larger. FMI
advises this share for absolute tolerances (2.0, section 2.2.7)."""
_SHARE_OF_SOLVER = 1e-3
"""The share of the tolerance that the solver of Model Exchange may use in each step."""
_WARNING = 1
"""The status of a warning in every version of FMI. More severe messages have a larger status."""


@dataclass(frozen=True)
class Finding:
    """The result for one variable of an experiment, or for an experiment that failed."""

    experiment: str
    variable: str
    deviation: float
    """The largest relative deviation from the expected values."""
    tolerance: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """True when the deviation is within the tolerance."""
        return self.deviation <= self.tolerance


def prove(
    fmu: Path,
    interface: str | None = None,
    tolerance: float | None = None,
    on_experiment: Callable[[str, float], None] = lambda *_: None,
) -> list[Finding]:
    """Run the experiments of an FMU and compare the results with the expected ones.

    The FMU runs in another process, so a script that calls this function needs `if __name__ == "__main__":`.

    `interface` is one of INTERFACES, by default the first that the FMU has. `tolerance` replaces those of the
    experiments. `on_experiment` is called before each experiment with its name and the share that is done.

    Raises FileError, and ProofError if the FMU ends its process.
    """
    import fmpy

    check_suffix(fmu, FMU)
    reference_results = ReferenceResults(fmu)
    with temporary_folder("fmu-") as folder:
        description = unpack_fmu(fmu, fmu, Path(folder))
        platforms = fmpy.supported_platforms(folder)
        experiments = reference_results.experiments(description)
        if fmpy.platform not in platforms:
            raise FileError(
                f"{fmu}: has no binary for this machine ({fmpy.platform}): {', '.join(platforms) or 'none'}"
            )
        available = [name for name, attribute in INTERFACES.items() if getattr(description, attribute)]
        if not available or (interface and interface not in available):
            raise FileError(
                f"{fmu}: has no {interface or 'interface that can be run'}, only {', '.join(available) or 'none'}"
            )
        chosen = [replace(x, tolerance=tolerance or x.tolerance) for x in experiments]
        found: list[Finding] = []
        with closing(_run_in_other_process(folder, interface or available[0], chosen)) as runs:
            for n, experiment in enumerate(chosen):
                on_experiment(experiment.name, n / len(chosen))
                try:
                    found += next(runs)
                except _DiedError as died:
                    where = one_line(f"{fmu}: experiment {experiment.name!r}")
                    raise ProofError(f"{where}: the FMU ended its process: {died}") from died
    return found


class _DiedError(Exception):
    """The process that ran the FMU has ended."""


def _run_in_other_process(folder: str, interface: str, experiments: Sequence[Experiment]) -> Generator[list[Finding]]:
    """Run the experiments in another process, and yield the findings of each. The process ends with the generator.

    A damaged library would end this process, and no interrupt would end a call that hangs. Raises _DiedError.
    """
    spawn = get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_send_findings, args=(there, folder, interface, experiments), daemon=True)
    with UNINTERRUPTED, ctrl_c_withheld():
        process.start()
    there.close()
    try:
        for _ in experiments:
            while not here.poll(0.1):  # on Windows an interrupt is handled between two waits
                pass
            yield here.recv()
    except (EOFError, OSError) as error:  # before or within a result
        process.join()
        code = process.exitcode or 0
        raise _DiedError(f"signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"exit code {code}") from error
    finally:
        process.kill()
        process.join()
        here.close()


def _send_findings(to: Connection, folder: str, interface: str, experiments: Sequence[Experiment]) -> None:
    """Run the experiments in the other process. It discards what the FMU prints and leaves interrupts to its parent."""
    import fmpy

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    description = fmpy.read_model_description(folder, validate=False)
    for experiment in experiments:
        to.send(list(_findings(folder, description, interface, experiment)))


def _findings(folder: str, description: Any, interface: str, experiment: Experiment) -> Iterator[Finding]:
    """Yield a finding for each variable, or a single one if the experiment fails or has no expected results."""
    import fmpy

    names = [*(experiment.references or ())][1:]
    kind = INTERFACES[interface]
    last_warning: deque[bytes] = deque(maxlen=1)

    def keep_warning(*arguments: Any) -> None:
        """Receive a message of the FMU. The last three arguments are the same in every version of FMI."""
        status, _, text = arguments[-3:]
        if status >= _WARNING:
            last_warning.append(text or b"")

    try:
        with redirect_stdout(io.StringIO()):  # FMPy's warnings
            result = fmpy.simulate_fmu(
                folder,
                validate=False,
                start_time=experiment.start,
                stop_time=experiment.stop,
                relative_tolerance=experiment.tolerance * (_SHARE_OF_SOLVER if interface == "model-exchange" else 1.0),
                output_interval=experiment.step,
                fmi_type=kind[0].upper() + kind[1:],
                start_values=dict(experiment.parameters),
                input=_signals(experiment.stimuli),
                output=names or None,
                model_description=description,
                remote_platform=None,
                debug_logging=True,
                logger=keep_warning,
            )
    except Exception as error:  # FMPy itself raises Exception, and the FMU may fail in any way
        message = "".join(f"; the FMU: {text.decode(errors='replace')}" for text in last_warning)
        what = str(error).replace(folder + os.sep, "").rstrip(".")  # keep the cause within 240 characters
        yield Finding(experiment.name, "-", inf, experiment.tolerance, brief(what + message, 240))
        return
    if not experiment.references:
        yield Finding(experiment.name, "-", 0.0, experiment.tolerance)
        return
    times, *expected = experiment.references.values()
    nominal = {v.name: float(v.nominal or 1.0) for v in description.modelVariables}
    for name, values in zip(names, expected, strict=True):
        scale = max(*map(abs, values), _SHARE_OF_NOMINAL * abs(nominal[name]))
        deviation = _deviation(result["time"], result[name], times, values)
        yield Finding(experiment.name, name, deviation / scale, experiment.tolerance)


def _signals(stimuli: Series | None) -> Any:
    """Return stimuli in the form that FMPy expects."""
    if stimuli is None:
        return None
    _, *names = stimuli
    return np.array(list(zip(*stimuli.values(), strict=True)), [(name, np.float64) for name in ("time", *names)])


def _deviation(times: Any, values: Any, at: Sequence[float], expected: Sequence[float]) -> float:
    """Return the largest deviation. At a time that occurs twice, before and after an event, the nearer value counts."""
    values = np.asarray(values, dtype=np.float64)
    largest = 0.0
    for t, value in zip(at, expected, strict=True):
        found = values[np.abs(times - t) <= _TIME_TOLERANCE * max(1.0, abs(t))]
        if not found.size:
            if not times[0] <= t <= times[-1]:
                return inf
            found = np.interp([t], times, values)
        deviation = float(np.min(np.abs(found - value)))
        largest = inf if isnan(deviation) else max(largest, deviation)
    return largest
