"""Runs of an unpacked FMU: for Co-Simulation with a new instance for each run, or else with FMPy's solver."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.fmus.instance import WARNING, Array, CallError, Instance, RunError, Unpacked, check_status, last_message
from rov_fmu.io.messages import brief


class Simulation:
    """An FMU that runs again and again, in a process of its own. Raises LoadError."""

    def __init__(
        self,
        folder: str,
        times: Array,
        step: float,
        start: Mapping[str, float],
        inputs: Mapping[str, Array],
        record: Sequence[str],
        varied: Sequence[str] = (),
        tolerance: float | None = None,
    ) -> None:
        """The inputs have a value for each step, and what is recorded is read at each of the times.

        `varied` names the variables that get other start values in each run.
        """
        self._times, self._step, self._tolerance, self._varied = times.tolist(), step, tolerance, varied
        instance = self._instance = Instance(Unpacked(folder))
        self._reads = instance.tables(record, len(times))
        self._start = instance.tables({**start, **dict.fromkeys(varied)})
        self._places = {name: table.values[0, n : n + 1] for table in self._start for n, name in enumerate(table.names)}
        for name, value in start.items():
            self._places[name][0] = value
        self._changes = defaultdict[int, list[tuple[Callable[[int], int], int]]](list)
        """By step, the calls that set the inputs which change at the beginning of this step."""
        for table in instance.tables(inputs, len(times) - 1):
            table.values[:] = np.transpose([inputs[name] for name in table.names])
            differs = np.any(table.values[1:] != table.values[:-1], axis=1)
            for n in [0, *(np.flatnonzero(differs) + 1).tolist()]:
                self._changes[n].append((table.set, n))

    def run(self, values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Run once, in a new instance, and return every recorded variable at every communication point.

        `values` are those of the varied variables. The next run overwrites the returned arrays. Raises RunError.
        """
        try:
            self._run(values)
        except CallError as failed:
            reason = str(failed)
            try:
                self._run(values, logging=True)
            except CallError as again:
                reason = f"{again}{last_message()}"
            raise RunError(brief(reason, 240)) from failed
        return {name: table.values[:, n] for table in self._reads for n, name in enumerate(table.names)}

    def _run(self, values: Sequence[float], *, logging: bool = False) -> None:
        instance, times, step, changes = self._instance, self._times, self._step, self._changes
        if instance.fmu.component is None:
            instance.renew(logging=logging)
        for name, value in zip(self._varied, values, strict=True):
            self._places[name][0] = value
        reads, do_step = [table.get for table in self._reads], instance.do_step
        try:
            instance.begin(times[0], times[-1], self._tolerance, self._set_start, self._set_first)
            for get in reads:
                check_status(get(0), "reading", times[0])
            for n in range(len(times) - 1):
                for put, row in changes.get(n, ()):
                    if (status := put(row)) > WARNING:
                        check_status(status, "setting the inputs", times[n])
                if (status := do_step(times[n], step)) > WARNING:
                    check_status(status, "the step", times[n])
                for get in reads:
                    if (status := get(n + 1)) > WARNING:
                        check_status(status, "reading", times[n + 1])
            instance.end()
        finally:
            instance.free()

    def _set_start(self) -> None:
        for table in self._start:
            check_status(table.set(0), "setting the start values")

    def _set_first(self) -> None:
        for put, row in self._changes.get(0, ()):
            check_status(put(row), "setting the inputs", self._times[0])


class Exchange:
    """An FMU for Model Exchange alone, which FMPy integrates by CVODE, in a process of its own."""

    def __init__(self, folder: str, times: Array, start: Mapping[str, float], record: Sequence[str]) -> None:
        """What is recorded is read at each of the times."""
        self._unpacked, self._times, self._start, self._record = Unpacked(folder), times, start, record

    def run(self, _values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Run once and return every recorded variable at every time. Raises RunError with FMPy's reason."""
        try:
            result = self._unpacked.simulated(
                start_time=self._times[0],
                stop_time=self._times[-1],
                output_interval=self._times[1] - self._times[0],
                start_values=dict(self._start),
                output=list(self._record),
            )
        except Exception as error:  # FMPy raises that itself
            raise RunError(brief(f"{self._unpacked.without_folder(error)}{last_message()}", 240)) from error
        return {name: np.interp(self._times, result["time"], result[name]) for name in self._record}
