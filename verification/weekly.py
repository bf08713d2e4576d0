"""python -m verification.weekly: all that does not run at each submission, and how long each part takes.

.ci/run has a sample of each. The parts run one after the other; the names of some run only these. A part that fails
does not keep the others from running.
"""

import shlex
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence

import click

from verification.checkouts import ROOT

PARTS: Mapping[str, tuple[str, Sequence[str]]] = {
    "tests": ("all cases of the tests", ["pytest -rs -m weekly"]),
    "strangers": (
        "verdicts about 60 vehicles",
        [
            "python -m verification.identification.strangers --seed 9240001 --folders 48 --processes 2",
            "python -m verification.identification.strangers --seed 9240101 --folders 12 --axes 4 --processes 2",
        ],
    ),
    "importers": (
        "every vehicle in every importer",
        ["python -m verification.interoperability --install", "python -m verification.interoperability"],
    ),
    "machines": ("the same results on all machines", ["python -m verification.machines"]),
    "mutation": ("a new sample of mutants", ["python -m verification.mutation"]),
    "fuzzing": ("an hour of fuzzing", ["python -m verification.fuzzing --seconds 3600"]),
}
"""By name: what the part is, and its commands. Each has a job of .github/workflows/weekly.yml."""


def run(name: str) -> bool:
    """Run the commands of a part, and return whether all of them ended well."""
    for command in PARTS[name][1]:
        print(f"$ {command}", flush=True)
        program, *arguments = shlex.split(command)
        words = [sys.executable, *(arguments if program == "python" else ["-m", program, *arguments])]
        if subprocess.run(words, cwd=ROOT, check=False).returncode:
            return False
    return True


@click.command(help=__doc__)
@click.option("--list", "is_list", is_flag=True, help="Print the parts.")
@click.argument("names", nargs=-1, type=click.Choice([*PARTS]))
def main(is_list: bool, names: Sequence[str]) -> None:
    """Run the parts, and print a table of the time of each."""
    if is_list:
        for name, (what, commands) in PARTS.items():
            print(f"{name}: {what}: {' && '.join(commands)}")
        return
    rows, failed = [], False
    for name in names or PARTS:
        began = time.monotonic()
        is_well = run(name)
        minutes, seconds = divmod(round(time.monotonic() - began), 60)
        rows.append(f"{minutes:4d}:{seconds:02d}  {name}: {PARTS[name][0]}" + ("" if is_well else ", FAILED"))
        failed |= not is_well
    print("\n".join(["minutes of each part", *rows]))
    sys.exit(failed)


if __name__ == "__main__":
    main()
