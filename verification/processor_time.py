"""A plugin of pytest that limits the processor time of a run, which a loaded machine does not change.

After $ROV_FMU_PROCESSOR_TIME s no other test begins, and the run has passed. A test that needs 40 % of it alone, where
the longest default test needs less than 7 % of the 150 s of the mutation test, ends the process by SIGXCPU.
"""

import os
import resource
from math import ceil

import pytest


def pytest_runtest_setup() -> None:
    """Give the process its processor time for another test."""
    limit, spent = float(os.environ["ROV_FMU_PROCESSOR_TIME"]), sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    if spent > limit:
        pytest.exit("there is no processor time left", 0)
    resource.setrlimit(resource.RLIMIT_CPU, (ceil(spent + 0.4 * limit), resource.getrlimit(resource.RLIMIT_CPU)[1]))
