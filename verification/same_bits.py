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
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

from verification.new_tests import environment, worktree

ROOT = Path(__file__).parents[1]
STEPS = 30
"""The number of steps of a run."""
_SHORTEST, _LONGEST = -4.0, 3.0
"""The decimal logarithms of the shortest and the longest step (s)."""
_SAVE, _RESTORE, _DESERIALIZE = 1, 2, 3
Floats = NDArray[np.float64]


# ---- The random runs -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Runs:
    """What is set in random runs. NaN leaves a value as it is. The first indices are the run and the step."""

    before: list[str]
    """The variables that are set before initialization: parameters, states and inputs."""
    start: Floats
    during: list[str]
    """The variables that are set before steps: tunable parameters, then inputs."""
    values: Floats
    inputs: list[str]
    seeds: Floats
    """The directions of the derivatives, in the space of the inputs."""
    lengths: Floats
    actions: NDArray[np.int64]


def random_runs(description: Any, runs: int) -> Runs:
    """Draw runs for the variables of an FMU. They are the same in every process."""
    draw = np.random.default_rng(40)
    variables = {v.name: v for v in description.modelVariables}
    parameters = [name for name, v in variables.items() if v.causality == "parameter"]
    inputs = [name for name, v in variables.items() if v.causality == "input"]
    tunable = [name for name in parameters if variables[name].variability == "tunable"]
    states = [unknown.variable.derivative.name for unknown in description.derivatives]
    states = [name for name in states if variables[name].initial == "exact"]

    def one(name: str, *shape: int) -> Floats:
        """Draw values of a variable within its bounds."""
        variable = variables[name]
        stated = variable.declaredType or variable  # FMI 3.0 has the bounds in the type
        low, high = float(stated.min or -np.inf), float(stated.max or np.inf)
        start = float(variable.start or 0.0)
        if np.isfinite(high - low) and name in inputs:  # commands, which saturate
            return draw.uniform(1.1 * low, 1.1 * high, shape)
        if name not in parameters:
            return start + 2.0 * float(stated.nominal or 1.0) * draw.normal(size=shape)
        values = start * np.exp(0.3 * draw.normal(size=shape)) if start else draw.normal(size=shape)
        return np.clip(values, low, high)

    def some(share: float, names: list[str], *shape: int) -> Floats:
        """Draw values of a share of the variables. A third of those of inputs are zero."""
        values = np.stack([one(name, *shape) for name in names], axis=-1)
        values[(draw.random(values.shape) < 0.3) & [name in inputs for name in names]] = 0.0
        return np.where(draw.random(values.shape) < share, values, np.nan)

    own = some(0.2, parameters, runs)
    own[draw.random(runs) < 0.5] = np.nan  # half of the runs have the parameters of the vehicle file
    tuned = some(0.3, tunable, runs, STEPS)
    tuned[draw.random((runs, STEPS)) < 0.9] = np.nan
    return Runs(
        before=[*parameters, *states, *inputs],
        start=np.concatenate([own, some(0.8, states, runs), some(0.8, inputs, runs)], axis=-1),
        during=[*tunable, *inputs],
        values=np.concatenate([tuned, some(0.7, inputs, runs, STEPS)], axis=-1),
        inputs=inputs,
        seeds=draw.normal(size=(runs, STEPS + 1, len(inputs))),
        lengths=10.0 ** draw.uniform(_SHORTEST, _LONGEST, (runs, STEPS)),
        actions=draw.choice([0, _SAVE, _RESTORE, _DESERIALIZE], (runs, STEPS), p=[0.85, 0.07, 0.05, 0.03]),
    )


class _Instance:
    """An instance for Co-Simulation of an unzipped FMU. FMPy raises FMICallException if a call fails."""

    def __init__(self, folder: Path) -> None:
        description = fmpy.read_model_description(str(folder), validate=False)
        self.vr = {v.name: v.valueReference for v in description.modelVariables}
        self.is_2 = description.fmiVersion == "2.0"
        self.type, self.state = ("Real", "FMUstate") if self.is_2 else ("Float64", "FMUState")
        self.slave = (FMU2Slave if self.is_2 else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rov",
        )
        self.slave.instantiate()

    def _call(self, name: str, *arguments: Any) -> Any:
        return getattr(self.slave, name)(*arguments)

    def set(self, names: Sequence[str], values: Floats) -> None:
        """Set the variables whose value is not NaN."""
        chosen = np.flatnonzero(~np.isnan(values)).tolist()
        self._call(f"set{self.type}", [self.vr[names[n]] for n in chosen], values[chosen].tolist())

    def get(self, references: list[int]) -> list[float]:
        values: list[float] = self._call(f"get{self.type}", references)
        return values

    def initialize(self) -> None:
        if self.is_2:
            self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def save(self) -> Any:
        return self._call(f"get{self.state}")

    def restore(self, state: Any, as_bytes: bool) -> None:
        """Restore a state, by way of its bytes if wanted."""
        if as_bytes:
            data = self._call(f"serialize{self.state}", state)
            state = self._call(f"{'deSerialize' if self.is_2 else 'deserialize'}{self.state}", data)
        self._call(f"set{self.state}", state)


def trajectories(folder: Path, names: list[str], unknowns: list[str], runs: Runs) -> tuple[NDArray[np.int64], Floats]:
    """Return the number of noted points of each run, and the values: run, point, variable.

    The points are the start and the end of each step, until a call fails. The values are those of the variables, and
    then the directional derivatives of the unknowns.
    """
    instance, n = _Instance(folder), len(runs.lengths)
    references, outputs, knowns = ([instance.vr[name] for name in group] for group in (names, unknowns, runs.inputs))
    points, values = np.zeros(n, dtype=int), np.zeros((n, STEPS + 1, len(names) + len(unknowns)))

    def note(run: int, point: int) -> None:
        change = instance.slave.getDirectionalDerivative(outputs, knowns, runs.seeds[run, point].tolist())
        values[run, point] = [*instance.get(references), *change]
        points[run] = point + 1

    def fly(run: int) -> None:
        t, saved = 0.0, None
        instance.set(runs.before, runs.start[run])
        instance.initialize()
        note(run, 0)
        for step, (h, action) in enumerate(zip(runs.lengths[run].tolist(), runs.actions[run], strict=True)):
            if action == _SAVE:
                saved = t, instance.save()
            elif action and saved:
                t, state = saved
                instance.restore(state, action == _DESERIALIZE)
            instance.set(runs.during, runs.values[run, step])
            instance.slave.doStep(t, h)
            t += h
            note(run, step + 1)

    for run in range(n):
        with suppress(FMICallException):
            fly(run)
        instance.slave.reset()
    return points, values


def _names(fmu: Path) -> tuple[Any, list[str], list[str]]:
    """Return the description of an FMU, its variables, and the unknowns of its directional derivatives."""
    description = fmpy.read_model_description(str(fmu), validate=False)
    unknowns = [unknown.variable.name for unknown in (*description.outputs, *description.derivatives)]
    return description, [v.name for v in description.modelVariables], unknowns


def fly(fmu: str, like: str, runs: str, target: str) -> None:
    """Make the runs that are drawn for the FMU `like` with another one, and write the trajectories to a file."""
    description, names, unknowns = _names(Path(like))
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(fmu, unzipdir=folder)
        points, values = trajectories(Path(folder), names, unknowns, random_runs(description, int(runs)))
    np.savez(target, points=points, values=values)


# ---- The comparison --------------------------------------------------------------------------------------------------


def differences(names: Sequence[str], old: Any, new: Any) -> tuple[list[str], int]:
    """Return a line for each variable that differs, and the number of runs whose bits are all equal."""
    (old_points, old_values), (new_points, new_values) = old, new
    differ = old_values.view(np.uint64) != new_values.view(np.uint64)
    length = old_points != new_points
    equal = int((~(differ.any(axis=(1, 2)) | length)).sum())
    lines = [f"  the failing step differs in {length.sum()} runs, first in {length.argmax()}"] if length.any() else []
    for n in np.flatnonzero(differ.any(axis=(0, 1))).tolist():
        where = differ[..., n]
        with np.errstate(invalid="ignore", over="ignore"):
            largest = abs(new_values[..., n] - old_values[..., n])[where].max()
        first = " and point ".join(map(str, np.argwhere(where)[0]))
        lines.append(f"  {names[n]} differs in {where.any(axis=1).sum()} runs, by {largest:.3g}, first in {first}")
    return lines, equal


def _python(tree: Path, *arguments: str | Path) -> None:
    """Run Python with the package of a checkout. Raises ClickException if it fails."""
    command, env = [sys.executable, *arguments], environment(tree)
    done = subprocess.run(command, cwd=tree, env=env, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise click.ClickException(f"exit code {done.returncode} of {arguments}\n{done.stdout}{done.stderr}")


def compare(old: Path, new: Path, runs: int) -> tuple[list[str], bool]:
    """Compare two FMUs. Return the lines of the report, and whether nothing differs."""
    made = []
    for fmu in (old, new):
        target = fmu.with_suffix(".npz")
        program = "import sys; from verification.same_bits import fly; fly(*sys.argv[1:])"
        _python(ROOT, "-c", program, fmu, old, str(runs), target)
        with np.load(target) as file:
            made.append((file["points"], file["values"]))
        target.unlink()
    _, names, unknowns = _names(old)
    lines, equal = differences([*names, *(f"change of {name}" for name in unknowns)], *made)
    if 2 * (made[0][0] <= STEPS).sum() > runs:
        lines.append("  more than half of the runs fail in OLD, so they show nothing")
    failed = " and ".join(f"{(points <= STEPS).sum()}" for points, _ in made)
    return [f"{runs} runs, {equal} with equal bits; a call fails in {failed} runs", *lines], not lines


@contextmanager
def _checkout(commit: str, folder: Path) -> Iterator[Path]:
    """Return the folder of a commit, or that of a checkout."""
    if Path(commit, "rov_fmu").is_dir():
        yield Path(commit).resolve()
    else:
        with worktree(commit, folder) as tree:
            yield tree


@click.command()
@click.argument("old")
@click.argument("new")
@click.option("--vehicle", "vehicles", multiple=True, help="A vehicle (default: all that ship in OLD).")
@click.option("--fmi", "versions", type=click.Choice(["2", "3"]), multiple=True, default=["2", "3"], help="Of FMI.")
@click.option("--runs", type=click.IntRange(1), default=1000, show_default=True, help="The number of runs.")
@click.option("--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="Processes at once.")
def main(old: str, new: str, vehicles: Sequence[str], versions: Sequence[str], runs: int, jobs: int) -> None:
    """Compare random runs of the shipped vehicles of two commits; exit with 1 when their bits differ."""
    with ExitStack() as stack, ThreadPoolExecutor(jobs) as pool:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="same-bits-"))).resolve()
        trees = [stack.enter_context(_checkout(commit, scratch / n)) for commit, n in ((old, "old"), (new, "new"))]
        shipped = [path.stem for path in sorted(trees[0].glob("models/*/*.toml")) if path.stem == path.parent.name]

        def compared(vehicle: str, fmi: str) -> tuple[list[str], bool]:
            fmus = [scratch / f"{vehicle}-{fmi}-{name}.fmu" for name in ("old", "new")]
            for tree, fmu in zip(trees, fmus, strict=True):
                _python(tree, "-m", "rov_fmu", "build", vehicle, "--fmi", fmi, "--platform", "host", "-o", fmu)
            return compare(fmus[0], fmus[1], runs)

        cases = [(vehicle, fmi) for vehicle in vehicles or shipped for fmi in versions]
        same = True
        for (vehicle, fmi), (lines, is_same) in zip(cases, pool.map(compared, *zip(*cases, strict=True)), strict=True):
            click.echo(f"{vehicle}, FMI {fmi}.0: " + "\n".join(lines))
            same &= is_same
    sys.exit(0 if same else 1)


if __name__ == "__main__":
    main()
