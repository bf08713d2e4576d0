"""An FMU proved by the experiments that it carries, run by FMPy."""

import io
import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, redirect_stdout
from dataclasses import dataclass, replace
from math import inf, isnan
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmu.experiments import Carried, Experiment
from rov_fmu.fmu.unpacking import unpack_fmu
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.interrupts import UNINTERRUPTED, ctrl_c_withheld, temporary_folder
from rov_fmu.io.messages import FileError, ProofError, brief, one_line
from rov_fmu.io.time_series import Series

INTERFACES = {"co-simulation": "coSimulation", "model-exchange": "modelExchange"}
"""By the name that a person gives: FMPy's."""
_SAME = 1e-9
"""Relative: two times that are one."""
_OF_NOMINAL = 0.01
"""A deviation is relative to the largest expected value, or to this share of the nominal one, which FMI advises for
absolute tolerances (2.0, section 2.2.7)."""
_OF_A_SOLVER = 1e-3
"""What the solver of Model Exchange may take of the tolerance at each step."""
_WARNING = 1
"""The status of a message, in every version of FMI; what is worse comes after it."""


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
    """Run the experiments of an FMU and compare. Raises FileError, and ProofError where the FMU ends its process.

    That is another one than this, so a script that calls this has its `if __name__ == "__main__":`.

    `interface` is one of INTERFACES; the first that the FMU has by default. A tolerance stands in place of those of the
    experiments. `on_experiment` is told of the one that comes next, and of the share that is done.
    """
    import fmpy

    check_suffix(fmu, FMU)
    carried = Carried(fmu)
    with temporary_folder("fmu-") as folder:
        description = unpack_fmu(fmu, fmu, Path(folder))
        platforms = fmpy.supported_platforms(folder)
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
        chosen = [replace(x, tolerance=tolerance or x.tolerance) for x in experiments]
        found: list[Finding] = []
        with closing(_apart(folder, interface or has[0], chosen)) as runs:
            for n, experiment in enumerate(chosen):
                on_experiment(experiment.name, n / len(chosen))
                try:
                    found += next(runs)
                except _DiedError as died:
                    where = one_line(f"{fmu}: experiment {experiment.name!r}")
                    raise ProofError(f"{where}: the FMU ended its process: {died}") from died
    return found


class _DiedError(Exception):
    """The process that ran the FMU is no more."""


def _apart(folder: str, interface: str, experiments: Sequence[Experiment]) -> Generator[list[Finding]]:
    """The findings of each experiment, from a process of its own, which ends with the generator. Raises _DiedError.

    A damaged library ends the process that loads it, and no interrupt ends a call that hangs.
    """
    spawn = get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_send_findings, args=(there, folder, interface, experiments), daemon=True)
    with UNINTERRUPTED, ctrl_c_withheld():
        process.start()
    there.close()
    try:
        for _ in experiments:
            while not here.poll(0.1):  # on Windows an interrupt comes between two waits
                pass
            yield here.recv()
    except (EOFError, OSError) as error:  # at the end, or amid an answer
        process.join()
        code = process.exitcode or 0
        raise _DiedError(f"signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"exit code {code}") from error
    finally:
        process.kill()
        process.join()
        here.close()


def _send_findings(to: Connection, folder: str, interface: str, experiments: Sequence[Experiment]) -> None:
    """The other side: what the FMU prints goes nowhere, and an interrupt is for the process that this one answers."""
    import fmpy

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    description = fmpy.read_model_description(folder, validate=False)
    for experiment in experiments:
        to.send(list(_findings(folder, description, interface, experiment)))


def _findings(folder: str, description: Any, interface: str, experiment: Experiment) -> Iterator[Finding]:
    """A line a variable, or one where the experiment has no expected results or fails."""
    import fmpy

    names = [*(experiment.references or ())][1:]
    kind = INTERFACES[interface]
    reasons: list[bytes] = []

    def keep(*told: Any) -> None:
        """A message of the FMU: its last arguments are the same in every version of FMI."""
        status, _, text = told[-3:]
        if status >= _WARNING:
            reasons[:] = [text or b""]

    try:
        with redirect_stdout(io.StringIO()):  # FMPy's warnings
            result = fmpy.simulate_fmu(
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
                debug_logging=True,
                logger=keep,
            )
    except Exception as error:  # FMPy raises that itself, and the FMU may fail in any way
        told = "".join(f"; the FMU: {text.decode(errors='replace')}" for text in reasons)
        what = str(error).replace(folder + os.sep, "").rstrip(".")  # the cause stands after the library's path
        yield Finding(experiment.name, "-", inf, experiment.tolerance, brief(what + told, 240))
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
