"""Studies: many runs of an FMU with uncertain parameters, and their results as data frames.

    import rov_fmu

    results = rov_fmu.run_study("plan.toml", "results")
    results.runs, results.trajectories(), results.bands("u"), results.sensitivity("stopping_distance")

Needs the extra `study`: pip install "rov-fmu[study]".
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rov_fmu.study.results.results import Results
    from rov_fmu.study.run.run_study import study
    from rov_fmu.study.run.work import Progress

__all__ = ["Progress", "Results", "study"]
_MODULES = {"Progress": "run.work", "Results": "results.results", "study": "run.run_study"}


def __getattr__(name: str) -> Any:
    """Import the module of a name on first use, because a process that only simulates needs neither Dask nor pandas."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"rov_fmu.study.{_MODULES[name]}"), name)
