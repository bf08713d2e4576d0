"""One child process reads the logs of all tests."""

from collections.abc import Iterator

import pytest

from rov_fmu.tank.readers.parsers import one_parser


@pytest.fixture(autouse=True, scope="session")
def one_process() -> Iterator[None]:
    """Start the process once, which takes half a second."""
    with one_parser():
        yield
