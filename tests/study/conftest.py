"""An FMU that this project did not build, and Dask workers for studies."""

from collections.abc import Iterator
from typing import Any

import dask
import pandas as pd
import pytest
from distributed import LocalCluster

from rov_fmu import Results
from tests.fmus.conftest import foreign
from tests.report.conftest import browser, engine, visit

__all__ = ["browser", "engine", "foreign", "visit"]


@pytest.fixture(scope="package")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalCluster]:
    """A worker that the tests of this folder share, because a start takes seconds.

    It has one thread, because each thread starts a process for the FMU in every study.
    """
    with (
        dask.config.set({"temporary-directory": str(tmp_path_factory.mktemp("cluster"))}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as started,
    ):
        yield started


@pytest.fixture(scope="package")
def scheduler(cluster: LocalCluster) -> str:
    """The address of the shared worker's scheduler."""
    return str(cluster.scheduler_address)


def same(results: Results, other: Results, rtol: float = 0.0) -> None:
    """Assert that two studies have the same rows, to the bit or within a relative error."""
    how: dict[str, Any] = {"rtol": rtol, "atol": 1e-13} if rtol else {"check_exact": True}
    pd.testing.assert_frame_equal(results.runs, other.runs, **how)
    pd.testing.assert_frame_equal(results.trajectories(), other.trajectories(), **how)
