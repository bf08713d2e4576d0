"""python -m rov_fmu: the same as the command rov-fmu."""

from rov_fmu.cli import run

if __name__ == "__main__":
    run()
