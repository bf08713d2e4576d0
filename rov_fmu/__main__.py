"""Run the command rov-fmu by `python -m rov_fmu`."""

import sys
from collections.abc import Sequence

from rov_fmu.process import run_process


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line as the whole process and return its exit code."""

    def main() -> int:
        from rov_fmu import cli  # imported here, where Ctrl-C is handled already

        return cli.main(arguments)

    try:
        return run_process("rov-fmu", main)
    except ModuleNotFoundError as error:  # a checkout that is not installed
        sys.exit(f"rov-fmu: the package {error.name} is not installed: pip install -e . (in a checkout)")


if __name__ == "__main__":
    sys.exit(run())
