"""python -m verification.same_bits OLD NEW: do the shipped vehicles of two commits move alike, to the last bit?

The FMUs of both commits are built on this machine, each by the code of its own commit, and make the same random runs.
No result is stored, because the mathematics library differs between machines. OLD and NEW can also be checkouts.

Each run begins with random states and parameters. Before each step it gets random commands, loads and currents, and now
and then tunable parameters or a saved state. The length of a step is between 0.1 ms and 1000 s. After each step all
variables of OLD and a directional derivative are compared.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, redirect_stdout, suppress
from itertools import product
from pathlib import Path
from typing import Any

import click
import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from verification.checkouts import checkout, environment
from verification.references.fmpy_slave import Slave

STEPS = 30
"""The number of steps of a run."""
_SHORTEST, _LONGEST = -4.0, 3.0
"""The decimal logarithms of the shortest and the longest step (s)."""
_SAVE, _RESTORE = 0.07, 0.08
"""How often the state is saved before a step, and how often the saved one is restored."""
Floats = NDArray[np.float64]


class Flight:
    """An unzipped FMU that makes runs. `columns` are its variables and the unknowns of its directional derivatives."""

    def __init__(self, folder: Path, description: Any) -> None:
        unknowns = [unknown.variable.name for unknown in (*description.outputs, *description.derivatives)]
        self.slave = Slave(folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self.columns = [*self.variables, *(f"change of {name}" for name in unknowns)]
        self._parameters, self._inputs = (
            [name for name, v in self.variables.items() if v.causality == causality]
            for causality in ("parameter", "input")
        )
        self._tunable = [name for name in self._parameters if self.variables[name].variability == "tunable"]
        states = [unknown.variable.derivative.name for unknown in description.derivatives]
        self._states = [name for name in states if self.variables[name].initial == "exact"]
        self._unknowns, self._knowns = (
            [self.slave.reference[name] for name in group] for group in (unknowns, self._inputs)
        )

    def fly(self, number: int) -> Floats:
        """Make the random run of a number. Return a row for its start and for the end of each step, until a call fails.

        What is drawn depends on the number and on the description alone, so two FMUs make the same run.
        """
        draw, rows = np.random.default_rng((40, number)), list[list[float]]()
        with suppress(FMICallException):
            own = self._some(draw, 0.2, self._parameters) if draw.random() < 0.5 else {}  # else those of the file
            self.slave.initialize(own | self._some(draw, 0.8, self._states) | self._some(draw, 0.8, self._inputs))
            rows.append(self._row(draw))
            now = 0.0
            saved: tuple[float, bytes] | None = None
            for _ in range(STEPS):
                action = draw.random()
                if action < _SAVE:
                    saved = now, self.slave.saved()
                elif action < _SAVE + _RESTORE and saved:
                    now = saved[0]
                    self.slave.restore(saved[1])
                tuned = self._some(draw, 0.3, self._tunable) if draw.random() < 0.1 else {}
                self.slave.put(tuned | self._some(draw, 0.7, self._inputs))
                length = 10.0 ** draw.uniform(_SHORTEST, _LONGEST)
                self.slave.step(now, length)
                now += length
                rows.append(self._row(draw))
        self.slave.fmu.reset()
        return np.array(rows).reshape(-1, len(self.columns))

    def _some(self, draw: np.random.Generator, share: float, names: Sequence[str]) -> dict[str, float]:
        """Draw values of a share of the variables. A third of those of inputs are zero."""
        chosen = [name for name in names if draw.random() < share]
        return {name: 0.0 if name in self._inputs and draw.random() < 0.3 else self._one(draw, name) for name in chosen}

    def _one(self, draw: np.random.Generator, name: str) -> float:
        """Draw a value of a variable within its bounds."""
        variable = self.variables[name]
        stated = variable.declaredType or variable  # FMI 3.0 has the bounds in the type
        low, high = float(stated.min or -np.inf), float(stated.max or np.inf)
        start = float(variable.start or 0.0)
        if np.isfinite(high - low) and name in self._inputs:  # commands, which saturate
            return draw.uniform(1.1 * low, 1.1 * high)
        if name not in self._parameters:
            return start + 2.0 * float(stated.nominal or 1.0) * draw.normal()
        value = start * np.exp(0.3 * draw.normal()) if start else draw.normal()
        return float(np.clip(value, low, high))

    def _row(self, draw: np.random.Generator) -> list[float]:
        """Return all variables, and their change in a direction that is drawn in the space of the inputs."""
        seed = draw.normal(size=len(self._knowns)).tolist()
        change = self.slave.fmu.getDirectionalDerivative(self._unknowns, self._knowns, seed)
        return [*self.slave.get(*self.variables), *change]


def differences(columns: Sequence[str], flights: Sequence[tuple[Floats, Floats]]) -> list[str]:
    """Return a line for each column that differs between the old and the new rows of some runs."""
    differs: dict[str, dict[int, float]] = {}
    for n, (old, new) in enumerate(flights):
        both = min(len(old), len(new))
        if len(old) != len(new):
            differs.setdefault("the step that fails", {})[n] = abs(len(old) - len(new))
        other = old[:both].view(np.uint64) != new[:both].view(np.uint64)
        for column in np.flatnonzero(other.any(axis=0)).tolist():
            with np.errstate(invalid="ignore", over="ignore"):
                size = np.abs(new[:both] - old[:both])[other[:, column], column].max()
            differs.setdefault(columns[column], {})[n] = float(size)
    return [
        f"  {name} differs in {len(sizes)} runs, by {max(sizes.values()):.3g}, first in {min(sizes)}"
        for name, sizes in differs.items()
    ]


def compare(trees: Sequence[Path], scratch: Path, vehicle: str, fmi: str, count: int) -> tuple[str, bool]:
    """Build a vehicle with two checkouts, and fly both. Return the report, and whether nothing differs."""
    folders = [scratch / f"{vehicle}-{fmi}-{n}" for n in range(len(trees))]
    for tree, folder in zip(trees, folders, strict=True):
        fmu = folder.with_suffix(".fmu")
        command = ["-m", "rov_fmu", "build", vehicle, "--fmi", fmi, "--platform", "host", "-o", str(fmu)]
        built = subprocess.run(
            [sys.executable, *command], cwd=tree, env=environment(tree), capture_output=True, text=True, check=False
        )
        if built.returncode != 0:
            raise click.ClickException(f"exit code {built.returncode} of {command}\n{built.stdout}{built.stderr}")
        fmpy.extract(str(fmu), unzipdir=str(folder))
    description = fmpy.read_model_description(str(folders[0]), validate=False)
    old, new = (Flight(folder, description) for folder in folders)
    with redirect_stdout(None):  # the warnings of the FMUs
        flights = [(old.fly(n), new.fly(n)) for n in range(count)]
    lines = differences(old.columns, flights)
    equal = sum(not differences(old.columns, [flight]) for flight in flights)
    failed = sum(len(rows) <= STEPS for rows, _ in flights)
    if 2 * failed > count:
        lines.append("  more than half of the runs fail in OLD, so they show nothing")
    head = f"{vehicle}, FMI {fmi}.0: {count} runs, {equal} with equal bits; a call fails in {failed} runs of OLD"
    return "\n".join([head, *lines]), not lines


@click.command()
@click.argument("old")
@click.argument("new")
@click.option("--vehicle", "vehicles", multiple=True, help="A vehicle (default: all that ship in OLD).")
@click.option("--fmi", "versions", type=click.Choice(["2", "3"]), multiple=True, default=["2", "3"], help="Of FMI.")
@click.option("--runs", type=click.IntRange(1), default=1000, show_default=True, help="The number of runs.")
@click.option("--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="Processes at once.")
def main(old: str, new: str, vehicles: Sequence[str], versions: Sequence[str], runs: int, jobs: int) -> None:
    """Compare random runs of the shipped vehicles of two commits; exit with 1 when their bits differ."""
    with ExitStack() as stack, ProcessPoolExecutor(jobs) as pool:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="same-bits-"))).resolve()
        trees = [stack.enter_context(checkout(commit, scratch / n)) for commit, n in ((old, "old"), (new, "new"))]
        shipped = [path.stem for path in sorted(trees[0].glob("models/*/*.toml")) if path.stem == path.parent.name]
        cases = product(vehicles or shipped, versions)
        same = True
        for compared in [pool.submit(compare, trees, scratch, *case, runs) for case in cases]:
            report, is_same = compared.result()
            click.echo(report)
            same &= is_same
    sys.exit(0 if same else 1)


if __name__ == "__main__":
    main()
