"""Studies: many runs of an FMU over what is uncertain, and their results as data frames.

    from rov_fmu.studies import study

    results = study("plan.toml", "results")
    results.runs, results.trajectories(), results.bands("u"), results.sensitivity("stopping_distance")

Needs the extra `study`: pip install "rov-fmu[study]".
"""

from rov_fmu.studies.engine import Progress
from rov_fmu.studies.results import Results
from rov_fmu.studies.run import study

__all__ = ["Progress", "Results", "study"]
