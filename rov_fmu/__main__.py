"""python -m rov_fmu: the same as the command rov-fmu."""

import sys
from collections.abc import Sequence
from functools import partial
from typing import NoReturn

from rov_fmu.process import run_process


def run(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line as a process of its own."""
    try:
        from rov_fmu.cli import main

        run_process(partial(main, arguments))
    except ModuleNotFoundError as error:  # a checkout that is not installed
        sys.exit(f"rov-fmu: the package {error.name} is not installed: pip install -e . (in a checkout)")


if __name__ == "__main__":
    run()
