"""Studies: many runs of an FMU over what is uncertain, and their results as data frames.

    from rov_fmu.studies import study

    results = study("plan.toml", "results")
    results.runs, results.trajectories(), results.bands("u"), results.sensitivity("stopping_distance")

Needs the extra `study`: pip install "rov-fmu[study]".
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rov_fmu.studies.engine import Progress
    from rov_fmu.studies.results import Results
    from rov_fmu.studies.run import study

__all__ = ["Progress", "Results", "study"]
_PLACES = {"Progress": "engine", "Results": "results", "study": "run"}


def __getattr__(name: str) -> Any:
    """Loaded as they are used: a process that does runs apart needs neither Dask nor pandas."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"rov_fmu.studies.{_PLACES[name]}"), name)
