"""The architecture page's rules: imports run one way, inside functions too, and no folder is too large to overlook."""

import ast
import inspect
import re
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest
import tomlkit
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import rov_fmu
from tests.commands import ROOT, python

# From the top down. A part imports from itself and from parts below it.
PARTS = (
    "cli",
    "study",
    "interface",
    "bridges",
    "build",
    "report",
    "prove",
    "fmus",
    "fmu",
    "autopilot",
    "identify",
    "tank",
    "c",
    "vehicle",
    "equation",
    "process",
    "io",
)
REFERENCES = "verification/references"
MAY_IMPORT = {
    "rov_fmu": {"rov_fmu"},
    REFERENCES: {REFERENCES, "rov_fmu"},
    "examples": {"examples", REFERENCES, "verification/published", "rov_fmu"},
    "verification/benchmarks": {"verification/benchmarks", REFERENCES, "rov_fmu"},
    "verification/fuzzing": {"verification/fuzzing", REFERENCES, "rov_fmu"},
    "verification/identification": {"verification/identification", REFERENCES, "rov_fmu"},
    "verification/interoperability": {
        "verification/interoperability",
        "verification/checkouts",
        REFERENCES,
        "examples",
        "rov_fmu",
    },
    "tests/verification": {"tests", "tests/verification", "verification", "examples", "rov_fmu"},
    "tests/docs": {"tests", "tests/docs", "docs", "examples", "rov_fmu", "verification/published", REFERENCES},
    "tests": {
        "tests",
        REFERENCES,
        "verification/fresh_environment",
        "verification/identification/strangers",
        "verification/published",
        "verification/tables",
        "rov_fmu",
    },
}
"""Which folders of this repository each folder may import. The innermost folder counts."""

LARGEST_FOLDER = 16


SHARED = {"Rov", "load", "place", "step"}
"""The names of classes and functions that two modules have."""


def _python_files(folder: Path) -> Iterator[Path]:
    """Yield the Python files in a folder. Folders that begin with a point hold installed importers."""
    for path in folder.iterdir():
        if path.is_dir() and not path.name.startswith("."):
            yield from _python_files(path)
        elif path.suffix == ".py":
            yield path


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


FILES = {
    _module(path): path
    for folder in ("rov_fmu", "verification", "examples", "tests")
    for path in _python_files(ROOT / folder)
}


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements in a node, without their expressions, which are most of a module and import nothing."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr):
            yield child
            yield from _statements(child)


def _names(module: str) -> Iterator[str]:
    """The full name of everything that a module imports, anywhere in it."""
    for node in _statements(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            outer = (*module.split("."), *(["__init__"] if FILES[module].name == "__init__.py" else []))
            base = ".".join([*(outer[: -node.level] if node.level else ()), *filter(None, [node.module])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _imports(module: str) -> set[str]:
    """The modules of this repository that a module imports. An import from a package counts as the package."""
    found = set()
    for name in _names(module):
        while name and name not in FILES:
            name = name.rpartition(".")[0]  # noqa: PLW2901 (the last part is not a module)
        found.add(name)
    return found - {"", module}


def test_each_folder_has_a_module_of_properties() -> None:
    """It says what must be true of everything that is drawn, or stands in a table."""
    folders = [part for part in PARTS if (ROOT / "rov_fmu" / part).is_dir()]
    assert [part for part in folders if not (ROOT / "tests" / part / "test_properties.py").exists()] == []


@pytest.fixture(scope="module")
def imports() -> dict[str, set[str]]:
    """The imports of every module."""
    return {module: _imports(module) for module in FILES}


def _part(module: str) -> str:
    return [*module.split("."), ""][1]


def test_type_checkers_see_the_public_names() -> None:
    stub = ast.parse((ROOT / "rov_fmu" / "__init__.pyi").read_text(encoding="utf-8"))
    typed = {one.name: node.module for node in stub.body if isinstance(node, ast.ImportFrom) for one in node.names}
    assert typed == rov_fmu.HOMES
    assert [name for name in typed if getattr(getattr(rov_fmu, name), "__module__", typed[name]) != typed[name]] == []


def test_a_public_name_belongs_to_one_module() -> None:
    """Of those in SHARED, programs outside use `Rov`, `load` and `step`."""
    homes: dict[str, set[str]] = {}
    for module, path in FILES.items():
        if module.startswith("rov_fmu"):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
                    homes.setdefault(node.name, set()).add(module)
    assert {name for name, modules in homes.items() if len(modules) > 1} <= SHARED


def test_nothing_imports_in_a_circle(imports: dict[str, set[str]]) -> None:
    try:
        TopologicalSorter(imports | {"rov_fmu": set()}).prepare()
    except CycleError as circle:
        pytest.fail(" < ".join(circle.args[1]))


def test_the_package_imports_downwards(imports: dict[str, set[str]]) -> None:
    below = {part: {*PARTS[n:], ""} for n, part in enumerate(PARTS)}
    below |= {"__main__": {"cli", "process"}, "": {*PARTS} - {"cli"}}
    upward = {
        f"{module} imports {name}"
        for module in FILES
        if module.split(".")[0] == "rov_fmu"
        for name in imports[module]
        if name.startswith("rov_fmu") and _part(name) not in below[_part(module)]
    }
    assert not upward


def test_the_page_has_the_parts_from_the_top_down() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| `(\w+)` \| [^|]+ \|$", page, re.M)
    assert shown == list(PARTS), "docs/architecture.md"


def test_the_step_in_python_imports_only_the_standard_library() -> None:
    """The FMU in pure Python contains it."""
    modules = [f"rov_fmu.equation.python.{name}" for name in ("step", "dop853")]
    outside = {name for module in modules for name in _names(module) if not any(_is_in(name, own) for own in modules)}
    assert outside
    assert {name.split(".")[0] for name in outside} <= sys.stdlib_module_names


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_folders_import_only_what_they_may(folder: str, imports: dict[str, set[str]]) -> None:
    inner = {module for other in MAY_IMPORT if other.startswith(f"{folder}/") for module in _within(other)}
    modules = _within(folder) - inner
    assert modules
    named = {name for module in modules for name in imports[module]}
    foreign = {name for name in named if not any(_is_in(name, other) for other in MAY_IMPORT[folder])}
    assert not foreign


def _is_in(module: str, folder: str) -> bool:
    package = folder.replace("/", ".")
    return module == package or module.startswith(f"{package}.")


def _within(folder: str) -> set[str]:
    return {module for module in FILES if _is_in(module, folder)}


def test_a_folder_does_not_have_too_many_modules() -> None:
    counts: dict[str, int] = {}
    for path in FILES.values():
        if path.name not in ("__init__.py", "__main__.py"):
            folder = path.parent.relative_to(ROOT).as_posix()
            counts[folder] = counts.get(folder, 0) + 1
    counts = {folder: count for folder, count in counts.items() if folder != "verification/interoperability/runners"}
    assert {folder: count for folder, count in counts.items() if count > LARGEST_FOLDER} == {}


def _exceptions(module: str) -> Iterator[type[Exception]]:
    """The classes of a module that are exceptions, by their names, which ruff checks."""
    tree = _statements(ast.parse(FILES[module].read_text(encoding="utf-8")))
    yield from (
        getattr(import_module(module), node.name)
        for node in tree
        if isinstance(node, ast.ClassDef) and node.name.endswith("Error")
    )


def test_all_exceptions_are_in_the_tree_that_the_first_one_prints() -> None:
    """Those that a caller can meet are public; those with a star are not, and private ones are left out."""
    own = {one for module in FILES if module.startswith("rov_fmu.") for one in _exceptions(module)}
    text = inspect.cleandoc(rov_fmu.RovError.__doc__ or "")  # Python 3.13 has no indentation there
    lines = re.findall(r"^ {4}( *)(\w+)( \*)?$", text, re.MULTILINE)
    above: list[str] = []
    printed = dict[str, str]()
    for indent, name, star in lines:
        del above[len(indent) // 4 :]
        printed[name] = above[-1] if above else ""
        above.append(name)
        assert (name in rov_fmu.__all__) == (not star), name
    real = {
        one.__name__: next((kind.__name__ for kind in one.__mro__[1:] if kind in own and kind.__name__[0] != "_"), "")
        for one in own
        if not one.__name__.startswith("_")
    }
    assert all(issubclass(one, rov_fmu.RovError) for one in own)
    assert printed == real
    assert [*printed] == sorted(printed, key=lambda name: _path(name, printed))


def _path(name: str, above: dict[str, str]) -> list[str]:
    """The names from the top of a tree down to one in it."""
    return [*(_path(above[name], above) if above[name] else []), name]


def _installed_without_extras() -> set[str]:
    """Return the distributions that `pip install -e .` brings, with what each of them requires."""
    project = tomlkit.parse((ROOT / "pyproject.toml").read_text(encoding="utf-8")).unwrap()["project"]
    found, left = {"rov-fmu"}, [*project["dependencies"]]
    while left:
        requirement = Requirement(left.pop())
        name = canonicalize_name(requirement.name)
        if name not in found and (requirement.marker is None or requirement.marker.evaluate({"extra": ""})):
            found.add(name)
            left += requires(name) or []
    return found


_WITHOUT = """
import sys

class Hidden:
    @staticmethod
    def find_spec(name, *_):
        if name in {!r}:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Hidden)
import {}
"""


@pytest.mark.long
def test_the_commands_of_the_readme_need_no_extra() -> None:
    installed = _installed_without_extras()
    modules = {name: {*map(canonicalize_name, of)} for name, of in packages_distributions().items()}
    extra = [name for name, of in modules.items() if not of & installed and name not in sys.stdlib_module_names]
    used = ["rov_fmu.cli", "rov_fmu.build", "rov_fmu.identify.identify", "rov_fmu.report.report", "examples.tank_tests"]
    program = _WITHOUT.format(extra, ", ".join(used))
    python("-c", program)
