"""An FMU that this project did not build, and Dask workers for studies."""

from collections.abc import Iterator

import dask
import pytest
from distributed import LocalCluster

from tests.fmus.conftest import foreign
from tests.report.conftest import browser, engine, visit

__all__ = ["browser", "engine", "foreign", "visit"]


@pytest.fixture(scope="package")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a scheduler with one worker, which the tests of this folder share: a start takes seconds."""
    with (
        dask.config.set({"temporary-directory": str(tmp_path_factory.mktemp("cluster"))}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as started,
    ):
        yield str(started.scheduler_address)
