"""Build an FMU from a vehicle file: the same as `rov-fmu build`."""

import sys

from rov_fmu.__main__ import run

if __name__ == "__main__":
    sys.exit(run(["build", *sys.argv[1:]]))
