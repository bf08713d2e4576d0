"""python -m verification.mutation: change single operators and constants at random, and see whether the tests notice.

The mutants are those of cosmic-ray (Python) and universalmutator (C), which `pip install "rov-fmu[mutation]"` installs.

Two parts of the product are not mutated: the scripts of the page, because the tests that would notice need a browser,
and the engine's and the page's frames around the C of the step, which no FMU contains.
"""

import ast
import contextlib
import fnmatch
import io
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cache, partial
from itertools import islice, takewhile
from pathlib import Path
from queue import SimpleQueue
from typing import Any
from xml.etree import ElementTree

import click

from rov_fmu.c.compile import C_FLAGS, UNITY_FILE, WARNINGS, compiler, fmi_headers
from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from verification.checkouts import ROOT, copy_checkout, environment
from verification.references.limited import run_limited

LEAST = 0.85
"""The share of the mutants that the tests must kill."""
FILES = ("rov_fmu/**/*.py", "fmu_src/c/*.c")
_LIMIT = 150
"""The processor time (s) after which no other test of a mutant begins: one that no test has noticed has survived."""
_HANGS = 40 * _LIMIT
"""The time (s) after which the tests hang, however loaded the machine is."""
TESTS = {
    "fmu_src/c/saved.c": "fmu/calls/test_state.py fmu/calls/test_state_bytes.py fmu/results/test_ballast.py fmu/calls",
    "fmu_src/c/[dt]*.c": "equation/thrust/test_thrust_effects.py fmu/calls/test_dead_time.py fmu/calls",
    "fmu_src/c/[ch]*.c": "equation/test_step.py equation/test_six_axes.py c equation fmu/calls",
    "fmu_src/c/[ls]*.c": "equation/test_step.py equation/test_alone.py equation c fmu/calls",
    "fmu_src/c/*": "fmu/calls/test_values.py fmu/calls/test_lifecycle.py fmu/calls/test_arguments.py fmu/calls "
    "fmu/results/test_ballast.py",
    "rov_fmu/equation/alone.py": "equation/test_alone.py equation/test_rov.py verification/test_published.py",
    "rov_fmu/equation/[cl]a*.py": "equation/table frozen/test_known_results.py docs/test_docs.py equation/test_rov.py "
    "vehicle equation",
    "rov_fmu/equation/dependencies.py": "frozen/test_known_results.py fmu/test_properties.py",
    "rov_fmu/equation/expression.py": "equation/table/test_expression.py report/test_properties.py equation "
    "fmu/calls/test_derivatives.py",
    "rov_fmu/equation/[pt]*.py": "equation/test_rov.py equation fmu/results/test_outside.py fmu/test_python_flavour.py",
    "rov_fmu/equation/*": "equation/test_rov.py equation/test_step.py equation/test_symmetries.py equation "
    "fmu/test_python_flavour.py",
    "rov_fmu/c/source.py": "equation/test_c_step.py fmu/test_sources.py c equation fmu/calls/test_derivatives.py",
    "rov_fmu/c/*": "fmu/test_build_failures.py c",
    "rov_fmu/vehicle/vehicle.py": "interface/test_model.py vehicle/test_vehicle.py vehicle equation/test_rov.py "
    "equation/test_six_axes.py",
    "rov_fmu/vehicle/checks.py": "vehicle/test_checks.py vehicle tank/test_description_mistakes.py",
    "rov_fmu/vehicle/description.py": "vehicle fmu/results/test_outside.py tank/test_description_mistakes.py",
    "rov_fmu/vehicle/shipped.py": "interface/test_model.py cli/test_messages.py",
    "rov_fmu/vehicle/uncertainty.py": "vehicle/test_uncertainty.py study/test_properties.py vehicle",
    "rov_fmu/vehicle/*": "vehicle/test_checks.py vehicle/test_vehicle.py vehicle/test_writer.py vehicle",
    "rov_fmu/identify/tuning.py": "identify/test_tuning.py identify",
    "rov_fmu/identify/likelihood/*": "identify/likelihood docs/test_identify_pages.py identify",
    "rov_fmu/identify/given.py": "tank/test_description_mistakes.py tank/test_description.py identify",
    "rov_fmu/identify/beginning.py": "tank/test_description_mistakes.py tank/test_tank_tests.py tank identify",
    "rov_fmu/identify/findings.py": "identify/test_findings.py frozen/test_known_results.py identify",
    "rov_fmu/identify/inspection/*": "frozen/test_known_results.py interface/test_inspect_command.py identify",
    "rov_fmu/identify/*": "identify/test_findings.py docs/test_identify_pages.py identify frozen/test_known_results.py",
    "rov_fmu/fmu/card.py": "frozen/test_known_results.py fmu/results/test_card.py report/test_card.py fmu",
    "rov_fmu/prove/experiments.py": "prove/test_properties.py cli/test_prove.py",
    "rov_fmu/prove/proof.py": "cli/test_prove.py prove",
    "rov_fmu/prove/*": "prove",
    "rov_fmu/fmu/*": "frozen/test_known_results.py fmu/test_properties.py fmu/test_terminals.py fmu",
    "rov_fmu/tank/description.py": "tank/test_description.py tank/test_description_mistakes.py "
    "identify/test_wrench.py tank",
    "rov_fmu/tank/readers/*": "tank/test_properties.py tank frozen/test_known_results.py identify/test_wrench.py",
    "rov_fmu/tank/log.py": "tank identify/likelihood/test_records.py identify/test_identify.py",
    "rov_fmu/tank/*": "tank frozen/test_known_results.py interface/test_inspect_command.py "
    "identify/test_wrench.py identify/test_identify.py identify/likelihood/test_beginning.py",
    "rov_fmu/report/plots/proof.py": "prove",
    "rov_fmu/report/plots/*": "frozen/test_known_results.py report/plots report/test_pictures.py report",
    "rov_fmu/report/page/live.py": "report/fly/test_flown.py report/test_fmu_page.py report",
    "rov_fmu/report/page/recording.py": "tank/test_several_files.py report/fly",
    "rov_fmu/report/page/*": "frozen/test_known_results.py report/test_properties.py report/test_fmu_page.py report",
    "rov_fmu/report/console_log.py": "frozen/test_known_results.py interface/test_inspect_command.py",
    "rov_fmu/report/console_results.py": "frozen/test_known_results.py identify/test_tuning.py",
    "rov_fmu/report/console.py": "report/test_console.py cli/test_prove.py fmu/results/test_evidence.py",
    "rov_fmu/report/progress.py": "report/test_console.py cli/test_terminal.py",
    "rov_fmu/report/*": "frozen/test_known_results.py report/test_report.py report",
    "rov_fmu/study/*": "study",
    "rov_fmu/interface/sitl_command.py": "bridges/test_sitl.py cli/test_targets.py",
    "rov_fmu/interface/export_command.py": "interface/test_export_command.py bridges",
    "rov_fmu/interface/tune_command.py": "cli/test_messages.py identify/test_tuning.py",
    "rov_fmu/interface/*": "interface cli/test_simulate.py cli/test_messages.py cli",
    "rov_fmu/autopilot/*": "autopilot bridges/autopilot bridges/test_ardusub_gains.py bridges/test_allocation.py",
    "rov_fmu/fmus/*": "fmus prove cli/test_prove.py bridges/system study",
    "rov_fmu/bridges/*": "bridges",
    "rov_fmu/io/columns.py": "io/test_csv_table.py",
    "rov_fmu/io/csv_table.py": "tank/test_logs.py tank/test_catalogue.py tank/test_tank_tests.py "
    "tank/readers/test_sources.py vehicle/test_thrust_tables.py prove/test_properties.py study/test_plans.py "
    "cli/test_messages.py io",
    "rov_fmu/fmu/picture.py": "report/test_own_pictures.py cli/test_inputs.py",
    "rov_fmu/io/templates.py": "report/test_own_pictures.py fmu/test_sources.py frozen/test_known_results.py",
    "rov_fmu/io/toml_file.py": "vehicle/test_checks.py vehicle/test_vehicle.py vehicle/test_json_schema.py "
    "vehicle/test_properties.py tank/test_description_mistakes.py study/test_plans.py cli/test_messages.py io",
    "rov_fmu/io/*": "io cli/test_messages.py cli/test_inputs.py cli",
    "rov_fmu/build.py": "fmu/test_build.py fmu/test_build_failures.py cli/test_targets.py fmu",
    "rov_fmu/cli.py": "interface/test_inspect_command.py fmu/test_build_failures.py cli study",
    "rov_fmu/*": "cli/test_start.py cli/test_messages.py cli",
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
    folder = ROOT / "tests" / (packages[1] if packages[1:] else "cli")
    tests = sorted(folder.rglob("test_*.py"), key=lambda path: (path.stem != f"test_{name}", path))
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
            before, change = (ROOT / file).read_text(encoding="utf-8"), generator.choice(choices)
            try:
                after = change()
            except AttributeError:  # cosmic-ray cannot replace an exception with a dotted name
                continue
            if _is_valid_python(before, after) if file.endswith(".py") else _is_valid_c(file, before, after):
                old, new = before.splitlines(), after.splitlines()
                if [*old[: line - 1], *old[line:]] == [*new[: line - 1], *new[line:]]:
                    yield Mutant(file, line, old[line - 1], new[line - 1], after)


# ---- Verdicts --------------------------------------------------------------------------------------------------------

_PYTEST = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"]


def _baseline(tests: Sequence[str], folder: Path, jobs: int) -> dict[str, float]:
    """Run tests without a mutant. Return the time of each file of tests in which all pass."""
    report = folder / "report.xml"
    command = [*_PYTEST, "-n", str(jobs), f"--junitxml={report}", *tests]
    subprocess.run(command, cwd=folder, env=environment(folder), stdout=subprocess.DEVNULL, check=False)
    if not report.exists():
        raise click.ClickException(f"the tests cannot be run without a mutant: pytest {' '.join(tests)}")
    seconds: dict[str, float] = defaultdict(float)
    failed = set()
    for case in ElementTree.parse(report).iter("testcase"):
        module = [*takewhile(lambda part: part.islower(), case.get("classname", "").split("."))]
        file = f"{'/'.join(module)}.py"
        seconds[file] += float(case.get("time", 0.0))
        if case.find("failure") is not None or case.find("error") is not None:
            failed.add(file)
    for file in sorted(failed):
        click.echo(f"left out, because a test fails without a mutant: {file}")
    return {file: took for file, took in seconds.items() if file not in failed}


def _quickest_first(file: str, seconds: Mapping[str, float]) -> list[str]:
    """Return the files of tests for a file that are in `seconds`: of each entry of its list, the quickest first."""
    entries = [ROOT / test for test in tests_of(file)]
    own = [e for e in entries if e.is_file()]
    groups = [own, *([*e.rglob("test_*.py")] for e in entries if e.is_dir())]
    names = ([path.relative_to(ROOT).as_posix() for path in group] for group in groups)
    ordered = (name for group in names for name in sorted({*group} & {*seconds}, key=lambda name: seconds[name]))
    return list(dict.fromkeys(ordered))


_BEGUN = re.compile(r"^(tests/\S+::.+?) (PASSED|SKIPPED|XFAIL|FAILED|ERROR|$)", re.M)


def _verdict(mutant: Mutant, folder: Path, seconds: Mapping[str, float]) -> tuple[str, str]:
    """Run the tests of a mutant in a copy of the checkout until one fails; return the verdict and the failing test."""
    tests = _quickest_first(mutant.file, seconds)
    limit = ["-p", "verification.processor_time", "-o", "faulthandler_timeout=600"]
    command = [*_PYTEST, "-n", "0", "-x", "-vv", *limit, "-o", "faulthandler_exit_on_timeout=true", *tests]
    limits = {"COLUMNS": "500", "ROV_FMU_PROCESSOR_TIME": str(_LIMIT)}
    code, output = run_limited(command, folder, environment(folder) | limits, _HANGS)
    if code == 0:
        return "survived", ""
    begun = _BEGUN.findall(output)
    return "killed", begun[-1][0] if begun else "the import"


def run(mutants: Sequence[Mutant], jobs: int) -> list[Mutant]:
    """Run the tests of every mutant in copies of the checkout, and print the verdicts. Return those that survive."""
    tests = sorted({test for mutant in mutants for test in tests_of(mutant.file)})
    with tempfile.TemporaryDirectory(prefix="mutation-") as temporary, ThreadPoolExecutor(jobs) as pool:
        copies: SimpleQueue[Path] = SimpleQueue()
        for n in range(jobs):
            copies.put(copy_checkout(Path(temporary, str(n))))
        seconds = _baseline(tests, Path(temporary, "0"), jobs)

        def judged(mutant: Mutant) -> tuple[str, str]:
            folder = copies.get()
            (folder / mutant.file).write_text(mutant.text, encoding="utf-8")
            found = _verdict(mutant, folder, seconds)
            shutil.copy2(ROOT / mutant.file, folder / mutant.file)
            copies.put(folder)
            return found

        left = []
        for n, (mutant, (verdict, test)) in enumerate(zip(mutants, pool.map(judged, mutants), strict=True), 1):
            click.echo(f"{n}/{len(mutants)} {verdict}: {mutant.file}:{mutant.line} {test}")
            if verdict == "survived":
                left.append(mutant)
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
    mutants = sorted(islice(draw(seed), sample), key=lambda mutant: (mutant.file, mutant.line))
    left = run(mutants, jobs)
    for mutant in left:
        click.echo(f"{mutant.file}:{mutant.line}\n    - {mutant.before.strip()}\n    + {mutant.after.strip()}")
    killed = 1.0 - len(left) / len(mutants)
    click.echo(f"{100.0 * killed:.0f} % of the mutants are killed; at least {100.0 * LEAST:.0f} % must be")
    sys.exit(0 if killed >= LEAST else 1)


if __name__ == "__main__":
    main()
