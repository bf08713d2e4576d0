"""What a run gives: its figures, its kept outputs, and how it ended."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.study.plan.figures import Figures
from rov_fmu.study.plan.prepared import Job

DONE, INCOMPLETE, FAILED = "done", "incomplete", "failed"
"""The statuses of a run: complete; it ended, but a figure cannot be computed; it did not end."""


@dataclass(frozen=True)
class Run:
    """What a run gave."""

    status: str
    reason: str
    """Why a figure is missing, or why the run did not end; otherwise empty."""
    figures: Sequence[float]
    kept: Sequence[npt.NDArray[Any]] = ()
    """The values of each kept output, if the run ended."""
    turned: bool = False
    """True if the vehicle turned over: it rolled or pitched by more than 90 degrees."""


def failed_run(job: Job, reason: str) -> Run:
    """Return a run that did not end."""
    return Run(FAILED, reason, [np.nan] * len(job.plan.figures))


class Evaluation:
    """Makes runs of the outputs that a plan needs, for one thread at a time."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._figures = Figures(job.plan.figures, job.plan.times)
        self._points = np.array(job.plan.kept_points, int)

    def run(self, values: Sequence[float], outputs: Mapping[str, npt.NDArray[Any]]) -> Run:
        """Return the run that has these values of the varied variables, and these outputs over time."""
        job = self._job
        figures, reason = self._figures.of({**dict(zip(job.varied, values, strict=True)), **outputs})
        kept = [outputs[name][self._points] for name in job.plan.kept]
        turned = any(np.any(np.abs(outputs[name]) > 0.5 * np.pi) for name in job.angles)
        return Run(INCOMPLETE if reason else DONE, reason, figures, kept, turned)
