"""Do the runs of a study on the workers of a Dask scheduler.

A worker unpacks the FMU once, and has a child process for each of its threads.
"""

import asyncio
import logging
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from uuid import uuid4

from distributed import Client, Security, Worker, rpc
from distributed.diagnostics.plugin import WorkerPlugin
from distributed.utils import silence_logging_cmgr

from rov_fmu.fmus.instance import Array
from rov_fmu.io.messages import FileError, RovError, StudyError, brief, reason_of
from rov_fmu.study.plan.study import Study
from rov_fmu.study.run.child import Children
from rov_fmu.study.run.run import Rows, rows_of
from rov_fmu.study.run.work import Work

_WAIT = 10.0
"""The seconds within which a scheduler must answer."""


def do_on_cluster(work: Work, scheduler: str) -> None:
    """Do all missing runs. Dask repeats a task whose worker died.

    Raises FileError, LoadError, StudyError, WriteError.
    """
    _check_scheduler(scheduler)
    with silence_logging_cmgr(logging.CRITICAL), Client(scheduler, timeout=_WAIT, set_as_default=False) as client:
        key = f"rov-fmu-{uuid4().hex}"
        try:
            client.register_plugin(Delivery(key, work.study))
        except Exception as error:  # whatever a worker may raise
            needs = "a worker cannot run the study. It needs the same version of rov-fmu[study] as this machine"
            raise StudyError(f"{needs}: {brief(reason_of(error))}") from error
        work.dashboard = client.dashboard_link or ""
        pool = client.get_executor(pure=False)
        try:
            work.do_tasks(lambda *task: pool.submit(do_runs, key, *task), lambda: sum(client.nthreads().values()))
        except RovError:
            raise
        except Exception as error:  # a client that has lost its scheduler raises various exceptions
            if isinstance(error, CancelledError | OSError) or client.status != "running":
                raise StudyError("the connection to the scheduler is lost. Finished runs are kept") from error
            raise
        finally:
            with suppress(Exception):  # the scheduler may be gone
                client.unregister_worker_plugin(key)


def _check_scheduler(scheduler: str) -> None:
    """Raise FileError if no scheduler answers. Without this check, the client would wait and print many lines."""

    async def ask() -> bool:
        async with rpc(scheduler, connection_args=Security().get_connection_args("client")) as there:
            return bool((await asyncio.wait_for(there.identity(), _WAIT))["type"] == "Scheduler")

    try:
        with ThreadPoolExecutor(1) as other:  # in a notebook, this thread already has an event loop
            is_there = other.submit(asyncio.run, ask()).result()
    except Exception:  # another kind of server may answer anything
        is_there = False
    if not is_there:
        raise FileError(f"--scheduler {scheduler}: no scheduler of Dask answers there")


# ---- On a worker -----------------------------------------------------------------------------------------------------


class Delivery(WorkerPlugin):
    """Brings a study to every worker, including those that are started or restarted later."""

    def __init__(self, key: str, study: Study) -> None:
        """`key` distinguishes the study from others on the same workers."""
        self.name, self._study = key, study

    def setup(self, worker: Worker) -> None:
        """Prepare a worker; Dask calls this when the worker starts."""
        _DELIVERED[self.name] = Children(self._study, worker.local_directory)

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002 (Dask passes it)
        """Clean up; Dask calls this when the study ends."""
        if children := _DELIVERED.pop(self.name, None):
            children.close()


_DELIVERED: dict[str, Children] = {}
"""The studies of this process, by their keys."""


def do_runs(key: str, first: int, values: Array) -> Rows:
    """Do the runs of a study that this worker has."""
    children = _DELIVERED[key]
    return rows_of(children.study, children.runs, first, values)
