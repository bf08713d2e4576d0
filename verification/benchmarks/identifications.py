"""Identify vehicles from folders, and print the processor time, the time on the clock, and the J of each.

`python -m examples.tank_tests` and `python -m examples.dive_log` write two such folders, and
`tests.identify.scenarios` those of scenarios.
"""

import time
from collections.abc import Sequence
from pathlib import Path

import click

from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify

from .page import Section, machine, print_sections


def section(folders: Sequence[Path]) -> Section:
    """Return the costs of reading each folder and of its identification, one run each."""
    rows = []
    for folder in folders:
        clock, processor = time.perf_counter(), time.process_time()
        found = identify(load_tests(folder))
        processor, clock = time.process_time() - processor, time.perf_counter() - clock
        rows.append([folder.name, f"{processor:.1f} s", f"{clock:.1f} s", f"{found.objective:.2f}"])
    return [["Identification", "processor", "clock", "J"], *rows]


@click.command(help=__doc__)
@click.argument("folders", nargs=-1, required=True, type=click.Path(exists=True, file_okay=False, path_type=Path))
def _command(folders: tuple[Path, ...]) -> None:
    print(machine())
    print_sections([section(folders)])


if __name__ == "__main__":
    _command()
