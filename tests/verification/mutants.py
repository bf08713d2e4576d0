"""Mutants: the package and the FMU's C with one operator or constant changed, which the tests must notice.

    python -m tests.verification.mutants [--sample 40] [--seed 1] [--jobs 2] [file or folder ...]

One small mutator for both languages: mutmut and cosmic-ray know Python alone, choose no tests by module and draw no
sample, which is most of what stands here.
"""

import argparse
import ast
import fnmatch
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue

import tomlkit

from tests.commands import ROOT

_LONGEST = 300.0  # s; a mutant that does not end is found
PLACES = ("rov_fmu", "fmu_src/c")

# By file, the first pattern that fits: the default tests that hold it, quick ones first.
_TESTS = {
    "fmu_src/c/saved.c": "fmu/calls/test_state fmu/calls/test_state_bytes verification/test_fuzz",
    "fmu_src/c/[rst]*.c": "model/test_c_step model/test_exactness fmu/calls/test_values fmu/calls/test_derivatives "
    "model/test_extremes model/test_rov verification/test_fuzz",
    "fmu_src/c/*": " ".join(
        f"fmu/calls/test_{part}"
        for part in (
            "values",
            "lifecycle",
            "arguments",
            "instantiation",
            "state",
            "state_bytes",
            "model_exchange",
            "event_mode",
            "intermediate_update",
            "derivatives",
        )
    )
    + " verification/test_fuzz",
    "rov_fmu/model/riccati.py": "model/test_riccati model/test_rov",
    "rov_fmu/model/step.py": "model/test_step model/test_symmetries model/test_exactness",
    "rov_fmu/model/dependencies.py": "model/test_dependencies fmu/test_dependencies",
    "rov_fmu/model/*": "model/test_rov fmu/test_declared_numbers model/test_symmetries model/test_exactness",
    "rov_fmu/identify/tuning.py": "identify/test_tuning identify/test_fuzzed_tables",
    "rov_fmu/identify/points/step_responses.py": "identify/test_step_responses identify/test_output_error",
    "rov_fmu/identify/*": "identify report/test_report",
    "rov_fmu/tank/mavlink.py": "tank/test_mavlink",
    "rov_fmu/tank/[ls][oi]g*.py": "tank/test_logs tank/test_mavlink",
    "rov_fmu/tank/smoothing.py": "tank/test_smoothing identify/test_step_responses identify/test_output_error",
    "rov_fmu/tank/columns.py": "tank/test_edges tank/test_logs tank/test_tank_tests identify/test_fuzzed_tables",
    "rov_fmu/tank/tank_tests.py": "tank/test_edges tank/test_tank_tests identify/test_identification",
    "rov_fmu/tank/[gn]*.py": "tank/test_given tank/test_given_mistakes tank/test_tank_tests",
    "rov_fmu/tank/*": "tank identify/test_dive",
    "rov_fmu/io/csv_table.py": "io tank/test_tank_tests vehicle/test_published",
    "rov_fmu/io/*": "io cli fmu/test_build_failures",
    "rov_fmu/vehicle/*": "vehicle",
    "rov_fmu/fmu/*": "fmu/test_declared_numbers fmu fmu/calls/test_arguments",
    "rov_fmu/report/*": "report/test_fmu_page report/test_report vehicle/test_published",
    "rov_fmu/*": "fmu/test_build cli fmu/test_build_failures",
}


@dataclass(frozen=True)
class Mutant:
    """A file with one change."""

    file: str
    before: str
    """The line that is changed; in Python as ast.unparse has it."""
    after: str
    text: str
    """Of the whole file, changed."""


def tests_of(file: str) -> list[str]:
    """The files and folders of tests that hold it."""
    names = next(tests for pattern, tests in _TESTS.items() if fnmatch.fnmatch(file, pattern)).split()
    return [f"tests/{name}.py" if "/" in name else f"tests/{name}" for name in names]


# ---- Python ----------------------------------------------------------------------------------------------------------

_SWAPS = (
    (ast.Add, ast.Sub),
    (ast.Mult, ast.Div),
    (ast.FloorDiv, ast.Mult),
    (ast.Mod, ast.Mult),
    (ast.Pow, ast.Mult),
    (ast.BitAnd, ast.BitOr),
    (ast.Lt, ast.LtE),
    (ast.Gt, ast.GtE),
    (ast.Eq, ast.NotEq),
    (ast.Is, ast.IsNot),
    (ast.In, ast.NotIn),
    (ast.And, ast.Or),
    (ast.USub, ast.UAdd),
)
_OTHER: dict[type[ast.AST], type[ast.AST]] = {b: a for a, b in reversed(_SWAPS)} | dict(_SWAPS)
_NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}
# Not behaviour: types, what decorators are told, and zip's check of itself.
_LEFT_OUT = {"annotation", "returns", "decorator_list"}


def _nodes(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for name, value in ast.iter_fields(node):
        if name not in _LEFT_OUT and getattr(node, "arg", None) != "strict":
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _nodes(child)


def _change(node: ast.AST) -> tuple[str, object] | None:  # noqa: PLR0911
    """An attribute of the node and what it becomes."""
    match node:
        case ast.BinOp(op=op) | ast.AugAssign(op=op) | ast.BoolOp(op=op) | ast.UnaryOp(op=op) if type(op) in _OTHER:
            return "op", _OTHER[type(op)]()
        case ast.UnaryOp(op=ast.Not()):
            return "operand", ast.UnaryOp(ast.Not(), node.operand)
        case ast.Compare(ops=[first, *rest]):
            return "ops", [_OTHER[type(first)](), *rest]
        case ast.Constant(value=bool(value)):
            return "value", not value
        case ast.Constant(value=int(value)):
            return "value", value + 1
        case ast.Constant(value=float(value)):
            return "value", 2.0 * value or 1.0
        case ast.Name(id=name) if name in _NAMES:
            return "id", _NAMES[name]
        case ast.If(test=test) | ast.IfExp(test=test) if not isinstance(test, ast.Compare | ast.BoolOp | ast.UnaryOp):
            return "test", ast.UnaryOp(ast.Not(), test)
    return None


def _in_python(file: str, text: str) -> Iterator[Callable[[], Mutant]]:
    tree = ast.parse(text)
    parts = [ast.unparse(top) for top in tree.body]

    def make(n: int, node: ast.AST, name: str, new: object) -> Mutant:
        old = getattr(node, name)
        setattr(node, name, new)
        changed = ast.unparse(tree.body[n])
        setattr(node, name, old)
        lines = zip(parts[n].splitlines(), changed.splitlines(), strict=False)
        before, after = next((before.strip(), after.strip()) for before, after in lines if before != after)
        return Mutant(file, before, after, "\n".join([*parts[:n], changed, *parts[n + 1 :]]))

    for n, top in enumerate(tree.body):
        for node in _nodes(top):
            if change := _change(node):
                yield partial(make, n, node, *change)


# ---- C ---------------------------------------------------------------------------------------------------------------

_C_SWAPS = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "&&": "||",
    "||": "&&",
    "+=": "-=",
    "-=": "+=",
    "*=": "/=",
    "|": "&",
    "&": "|",
    "true": "false",
    "false": "true",
    "!": "",
}
_C_TOKEN = re.compile(
    r"(?<=\s)(?:[-+*]=?|/|[<>]=?|[=!]=|&&|\|\||[&|])(?=\s)"  # between two operands
    r"|(?<=[(\s])[-!](?=[\w(])|\btrue\b|\bfalse\b"
    r"|(?<![\w.])(?:\d+\.\d*(?:e[-+]?\d+)?(?![\w.])|\d+(?=[uU]?\b(?!\.)))"
)
_C_LEFT_OUT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|^[ \t]*#(?:\\\n|[^\n])*', re.DOTALL | re.MULTILINE)


def _in_c(file: str, text: str) -> Iterator[Callable[[], Mutant]]:
    def make(token: str, start: int) -> Mutant:
        number = (
            str(int(token) + 1) if token.isdigit() else repr(2.0 * float(token) or 1.0) if token[0].isdigit() else ""
        )
        first, last = text.rfind("\n", 0, start) + 1, text.find("\n", start)
        changed = text[first:start] + (number or _C_SWAPS[token]) + text[start + len(token) : last]
        return Mutant(file, text[first:last].strip(), changed.strip(), text[:first] + changed + text[last:])

    code = _C_LEFT_OUT.sub(lambda found: "\0" * len(found[0]), text)
    return (partial(make, found[0], found.start()) for found in _C_TOKEN.finditer(code))


def mutants_of(file: str, text: str) -> Iterator[Callable[[], Mutant]]:
    """All mutants of a file, each to be made when it is needed."""
    return (_in_python if file.endswith(".py") else _in_c)(file, text)


def files(places: Sequence[str] = PLACES) -> list[str]:
    """The sources of files and folders, seen from the checkout."""
    paths = [path for place in places for path in (sorted((ROOT / place).rglob("*")) or [ROOT / place])]
    return [path.relative_to(ROOT).as_posix() for path in paths if path.suffix in {".py", ".c"}]


def sites(places: Sequence[str] = PLACES) -> list[Callable[[], Mutant]]:
    """All mutants of files and folders."""
    return [make for f in files(places) for make in mutants_of(f, (ROOT / f).read_text(encoding="utf-8"))]


def equivalents() -> dict[tuple[str, str], str]:
    """Why no test can tell a mutant from the line of today, by file and mutated line."""
    listed = tomlkit.parse(Path(__file__).with_name("equivalent_mutants.toml").read_text(encoding="utf-8")).unwrap()
    return {(file, line): reason for reason, lines in listed.items() for file, line in lines}


# ---- Run -------------------------------------------------------------------------------------------------------------


def _copy(folder: Path) -> Path:
    """The checkout as it stands, without what git does not look at."""
    listed = subprocess.run(
        ["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True
    )
    for name in filter(lambda name: name and (ROOT / name).is_file(), listed.stdout.decode().split("\0")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def _test(folder: Path, tests: Sequence[str]) -> tuple[bool, str]:
    """Whether the tests pass, and what they print."""
    process = subprocess.Popen(
        [sys.executable, "-B", "-m", "pytest", "-n", "0", "-x", "-p", "no:cacheprovider", *tests],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        said = process.communicate(timeout=_LONGEST)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said = process.communicate()[0]
    return process.returncode == 0, said


def run(mutants: Sequence[Mutant], jobs: int) -> Iterator[tuple[Mutant, str]]:
    """Run the tests of every mutant; each as it is `killed`, has `survived`, or is `stillborn`: no program."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(jobs) as pool:
        copies: SimpleQueue[Path] = SimpleQueue()
        for n in range(jobs):
            copies.put(_copy(Path(folder, str(n))))

        def one(mutant: Mutant, text: str | None = None) -> str:
            copy = copies.get()
            whole = (copy / mutant.file).read_bytes()
            (copy / mutant.file).write_text(mutant.text if text is None else text, encoding="utf-8")
            passed, said = _test(copy, tests_of(mutant.file))
            (copy / mutant.file).write_bytes(whole)
            copies.put(copy)
            assert passed or text is None, f"the tests fail without a mutant:\n{said}"
            return "survived" if passed else "stillborn" if "the compiler failed" in said else "killed"

        for mutant in mutants[:1]:  # what fails as it is would kill them all
            one(mutant, (ROOT / mutant.file).read_text(encoding="utf-8"))
        futures = {pool.submit(one, mutant): mutant for mutant in mutants}
        for future in as_completed(futures):
            yield futures[future], future.result()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a sample; 0 where enough of the mutants that are not known as equivalent are killed."""
    parser = argparse.ArgumentParser(prog="python -m tests.verification.mutants")
    parser.add_argument("places", nargs="*", default=PLACES, help="files and folders to change")
    parser.add_argument("--sample", type=int, default=sys.maxsize, help="so many, drawn at random (default: all)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="side by side")
    parser.add_argument("--least", type=float, default=0.9, help="share that must be killed (default: 0.9)")
    asked = parser.parse_args(arguments)
    every, known, counts = sites(asked.places), equivalents(), Counter[tuple[str, str]]()
    drawn = [make() for make in random.Random(asked.seed).sample(every, min(asked.sample, len(every)))]
    for mutant, end in run([m for m in drawn if (m.file, m.after) not in known], asked.jobs):
        counts[str(Path(mutant.file).parent), end] += 1
        print(f"{end} {mutant.file}: {mutant.before}\n    -> {mutant.after}", flush=True)
    for place in sorted({place for place, _ in counts}):
        print(f"{place}: {counts[place, 'killed']} killed, {counts[place, 'survived']} survived")
    killed, survived = (sum(n for (_, end), n in counts.items() if end == ended) for ended in ("killed", "survived"))
    return int(killed < asked.least * (killed + survived))


if __name__ == "__main__":
    sys.exit(main())
