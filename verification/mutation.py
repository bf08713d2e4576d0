"""python -m verification.mutation: change single operators and constants at random, and see whether the tests notice.

The mutants are those of cosmic-ray (Python) and universalmutator (C), which `pip install "rov-fmu[mutation]"` installs.
"""

import ast
import contextlib
import fnmatch
import io
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cache, partial
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import click

from rov_fmu.engine.compile import C_FLAGS, UNITY_FILE, WARNINGS, compiler, fmi_headers
from rov_fmu.fmu.archive import native_content
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

ROOT = Path(__file__).parents[1]
LEAST = 0.85
"""The share of the mutants that the tests must kill."""
_LONGEST = 120
"""The longest time (s) of one test; one that takes longer has noticed its mutant."""
FILES = (
    *(f"rov_fmu/{folder}/**/*.py" for folder in ("model", "engine", "vehicle", "identify", "fmu")),
    "fmu_src/c/*.c",
)
TESTS = {
    "fmu_src/c/saved.c": "fmu/calls/test_state.py fmu/calls/test_state_bytes.py fmu/calls",
    "fmu_src/c/s*.c": "model/test_c_step.py fmu/calls/test_values.py fmu/calls model/test_exactness.py engine",
    "fmu_src/c/*": "fmu/calls/test_values.py fmu/calls/test_lifecycle.py fmu/calls/test_arguments.py fmu/calls",
    "rov_fmu/model/riccati.py": "model/test_riccati.py model/test_rov.py vehicle/test_published.py",
    "rov_fmu/model/layout.py": "model/table docs/test_docs.py model/test_rov.py vehicle/test_vehicle.py model",
    "rov_fmu/model/*": "model/test_rov.py model/test_step.py model/test_symmetries.py model",
    "rov_fmu/engine/source.py": "model/test_c_step.py fmu/test_sources.py engine model",
    "rov_fmu/engine/*": "fmu/test_build_failures.py engine",
    "rov_fmu/vehicle/vehicle.py": "interface/test_model.py vehicle/test_vehicle.py vehicle",
    "rov_fmu/vehicle/*": "vehicle/test_checks.py vehicle/test_vehicle.py vehicle/test_writer.py vehicle",
    "rov_fmu/identify/points/*": "identify/points/test_response_fit.py identify/points/test_thrust_fit.py identify",
    "rov_fmu/identify/slips/*": "identify/test_slips.py identify",
    "rov_fmu/identify/*": "identify/test_simulator.py identify/test_dive.py identify",
    "rov_fmu/fmu/experiments.py": "cli/test_prove.py fmu",
    "rov_fmu/fmu/proof.py": "cli/test_prove.py fmu",
    "rov_fmu/fmu/*": "fmu/test_declared_numbers.py fmu/test_osp.py fmu/test_terminals.py fmu",
}
"""The default tests of each file, in the folder tests/, besides those that import it. The first pattern counts."""
# Their mutants need arguments, change a decorator, or raise a TypeError wherever they run. `is` still becomes `is not`.
_LEFT_OUT_OPERATORS = re.compile(r"Variable|Decorator|Shift|Bit|Invert|NoOp|(Eq|Lt|LtE|Gt|GtE)_Is|Is(Not)?_(?!Is)")
_C_STRING = re.compile(r'"(?:\\.|[^"\\\n])*"')


@dataclass(frozen=True)
class Mutant:
    """A file with one line changed."""

    file: str
    line: int
    before: str
    after: str
    text: str
    """The text of the changed file."""


def files() -> list[str]:
    """Return the files that are mutated, relative to the checkout."""
    return sorted(path.relative_to(ROOT).as_posix() for pattern in FILES for path in ROOT.glob(pattern))


def tests_of(file: str) -> list[str]:
    """Return the files and folders of tests for a file: those that import it, then those of the table."""
    *packages, name = Path(file).with_suffix("").parts
    is_imported = re.compile(rf"{re.escape('.'.join(packages))}(\.{name} import| import (.*, )?{name}\b)")
    tests = sorted(
        (ROOT / "tests" / packages[1]).rglob("test_*.py"), key=lambda path: (path.stem != f"test_{name}", path)
    )
    importing = [path.relative_to(ROOT).as_posix() for path in tests if is_imported.search(path.read_text("utf-8"))]
    names = next(names for pattern, names in TESTS.items() if fnmatch.fnmatch(file, pattern))
    return list(dict.fromkeys([*importing, *(f"tests/{name}" for name in names.split())]))


_Mutants = Mapping[int, list[Callable[[], str]]]
"""Functions that make the changed texts of a file, by line."""

# ---- Mutants ---------------------------------------------------------------------------------------------------------


@cache
def _operators() -> list[type]:
    """Return the operators of cosmic-ray, without those whose mutants say nothing about the tests."""
    from cosmic_ray.plugins import get_operator, operator_names

    return [get_operator(name) for name in sorted(operator_names()) if not _LEFT_OUT_OPERATORS.search(name)]


def _is_code(node: Any) -> bool:
    """Return False for a node of parso that is a decorator, an annotation, a type-checking block, zip's `strict`, or an
    error with its message."""
    parent = node.parent
    if node.type == "if_stmt":
        return "TYPE_CHECKING" not in node.children[1].get_code()
    if node.type == "argument":
        return not node.get_code(include_prefix=False).startswith("strict")
    if parent.type in ("tfpdef", "annassign"):  # `name: type` of a parameter, `: type = value` of a variable
        return node is not parent.children[2 if parent.type == "tfpdef" else 1]
    if node.type in ("decorator", "decorators", "raise_stmt"):
        return False
    return node is not getattr(parent, "annotation", None)


def _python_mutants(text: str) -> _Mutants:
    """Return the mutants of a Python module."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code

    tree = get_ast(text)
    nodes, code = list(ast_nodes(tree)), {id(tree)}
    for node in nodes:  # parents come before their children
        if id(node) in code:
            code |= {id(child) for child in getattr(node, "children", []) if _is_code(child)}
    found: dict[int, list[Callable[[], str]]] = defaultdict(list)
    for operator in _operators():
        places = [(id(node), start[0]) for node in nodes for start, _ in operator().mutation_positions(node)]
        for occurrence, (node, line) in enumerate(places):
            if node in code:
                found[line].append(partial(mutate_code, text, operator(), occurrence))
    return found


def _c_mutants(text: str) -> _Mutants:
    """Return the mutants of a C file."""
    from universalmutator.mutator import mutants_regexp

    lines = text.splitlines(keepends=True)
    found: dict[int, list[Callable[[], str]]] = defaultdict(list)
    with contextlib.redirect_stdout(io.StringIO()):
        made = mutants_regexp(lines, ruleFiles=["universal.rules", "c_like.rules", "c.rules"], ignorePatterns=[])
    for line, changed, *_ in made:
        found[line].append(partial("".join, [*lines[: line - 1], changed, *lines[line:]]))
    return found


@cache
def _mutants(file: str) -> _Mutants:
    """Return the mutants of a file."""
    text = (ROOT / file).read_text(encoding="utf-8")
    return _python_mutants(text) if file.endswith(".py") else _c_mutants(text)


def _is_valid_python(before: str, after: str) -> bool:
    """Return True when the changed module can be compiled and differs in more than its layout."""
    try:
        return ast.dump(ast.parse(before)) != ast.dump(ast.parse(after))
    except SyntaxError:
        return False


@cache
def _c_sources(fmi: int) -> Mapping[str, str]:
    """Return the C files of an FMU for this version of FMI."""
    return native_content(load_vehicle(SHIPPED["bluerov2_heavy"]), fmi=fmi).sources


@cache
def _object(name: str, text: str) -> bytes | None:
    """Return the compiled FMU with this text of a C file, or None when a build would not accept it without warnings."""
    with tempfile.TemporaryDirectory() as folder:
        for source, content in {**_c_sources(3 if name.startswith("fmi3") else 2), name: text}.items():
            Path(folder, source).write_text(content, encoding="utf-8")
        # It is compiled only to be compared, so the loops of a step need not be unrolled.
        flags = [*C_FLAGS, *WARNINGS, "-g0", "-Dalways_inline=noinline", "-isystem", str(fmi_headers())]
        command = [*compiler(), *flags, "-c", UNITY_FILE, "-o", "fmu.o"]
        accepted = subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 0
        return Path(folder, "fmu.o").read_bytes() if accepted else None


def _is_valid_c(file: str, before: str, after: str) -> bool:
    """Return True when the compiler accepts the changed file, and more than its messages and its layout has changed."""
    old, new = (_C_STRING.sub('""', text) for text in (before, after))
    compiled = old != new and _object(Path(file).name, after)
    return bool(compiled) and compiled != _object(Path(file).name, before)


def draw(seed: int) -> Iterator[Mutant]:
    """Yield mutants of lines drawn at random, each line at most once."""
    generator = random.Random(seed)
    lines = [(file, n) for file in files() for n in range(1, 1 + (ROOT / file).read_text(encoding="utf-8").count("\n"))]
    generator.shuffle(lines)
    for file, line in lines:
        if choices := _mutants(file).get(line):
            before, after = (ROOT / file).read_text(encoding="utf-8"), generator.choice(choices)()
            if _is_valid_python(before, after) if file.endswith(".py") else _is_valid_c(file, before, after):
                old, new = before.splitlines()[line - 1], after.splitlines()[line - 1]
                yield Mutant(file, line, old.strip(), new.strip(), after)


# ---- Tests -----------------------------------------------------------------------------------------------------------


def _copy(folder: Path) -> Path:
    """Copy the files of the checkout that git does not ignore."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
    for name in names:
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def _pass(tests: Sequence[str], folder: Path, processes: int = 0, longest: float | None = None) -> bool:
    """Return True when the tests pass in a copy of the checkout, each in _LONGEST and all in `longest` seconds."""
    limit = ["-o", f"faulthandler_timeout={_LONGEST}", "-o", "faulthandler_exit_on_timeout=true"]
    command = [sys.executable, "-m", "pytest", "-n", str(processes), "-x", "-p", "no:cacheprovider", *limit, *tests]
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        return process.wait(longest) == 0
    except subprocess.TimeoutExpired:  # a mutant may also hang when it is imported
        return False
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # with what the tests have started


def survivors(mutants: Sequence[Mutant], jobs: int) -> list[Mutant]:
    """Run the tests of every mutant in copies of the checkout; return the mutants that no test has noticed."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as temporary, ThreadPoolExecutor(jobs) as pool:
        copies: SimpleQueue[Path] = SimpleQueue()
        for n in range(jobs):
            copies.put(_copy(Path(temporary, str(n))))
        tests, began = sorted({test for mutant in mutants for test in tests_of(mutant.file)}), time.monotonic()
        if not _pass(tests, Path(temporary, "0"), jobs):
            raise click.ClickException(f"the tests fail without a mutant: pytest {' '.join(tests)}")
        took = time.monotonic() - began
        click.echo(f"the tests pass without a mutant, in {took:.0f} s")
        longest = _LONGEST + jobs * took

        def survives(mutant: Mutant) -> tuple[bool, float]:
            folder, began = copies.get(), time.monotonic()
            (folder / mutant.file).write_text(mutant.text, encoding="utf-8")
            passed = _pass(tests_of(mutant.file), folder, longest=longest)
            shutil.copy2(ROOT / mutant.file, folder / mutant.file)
            copies.put(folder)
            return passed, time.monotonic() - began

        left = []
        for n, (mutant, (survived, took)) in enumerate(zip(mutants, pool.map(survives, mutants), strict=True), 1):
            verdict = "survived" if survived else "killed"
            click.echo(f"{n}/{len(mutants)} {verdict} after {took:.0f} s: {mutant.file}:{mutant.line}")
            left += [mutant] if survived else []
        return left


@click.command()
@click.option("--sample", type=click.IntRange(1), default=60, show_default=True, help="The number of mutants.")
@click.option("--seed", type=int, help="The seed of the sample (default: year and ISO week, e.g. 202607).")
@click.option(
    "--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="Tests at once (default: processors)."
)
def main(sample: int, seed: int | None, jobs: int) -> None:
    """Change random lines, one at a time; exit with 1 when the tests kill less than 85 % of the mutants."""
    year, week, _ = datetime.now(timezone.utc).isocalendar()
    seed = 100 * year + week if seed is None else seed
    click.echo(f"{sample} mutants with seed {seed}")
    mutants = list(islice(draw(seed), sample))
    left = survivors(mutants, jobs)
    for mutant in left:
        click.echo(f"{mutant.file}:{mutant.line}\n    - {mutant.before}\n    + {mutant.after}")
    killed = 1.0 - len(left) / len(mutants)
    click.echo(f"{100.0 * killed:.0f} % of the mutants are killed; at least {100.0 * LEAST:.0f} % must be")
    sys.exit(0 if killed >= LEAST else 1)


if __name__ == "__main__":
    main()
