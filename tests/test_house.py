"""The house of DESIGN.md: imports run one way, inside functions too, and nothing imports in a circle."""

import ast
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.commands import ROOT

# From the top down. A part imports from itself and from parts below it; files/ and model/ stand side by side.
PARTS = (
    "cli",
    "studies",
    "interface",
    "build",
    "pages",
    "export",
    "identify",
    "tank",
    "engine",
    "vehicle",
    "process",
    "files",
)
AROUND = {
    "rov_fmu": {"rov_fmu"},
    "checks": {"checks", "rov_fmu"},
    "examples": {"examples", "checks", "rov_fmu"},
    "benchmarks": {"benchmarks", "checks", "rov_fmu"},
    "fuzz": {"fuzz", "checks", "rov_fmu"},
    "interop": {"interop", "checks", "examples", "rov_fmu"},
    "tests/around": {"tests", "benchmarks", "checks", "examples", "fuzz", "interop", "rov_fmu"},
    "tests": {"tests", "checks", "rov_fmu"},
}
"""Whom of this repository each folder may import; the innermost folder counts."""


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


FILES = {
    _module(path): path
    for folder in AROUND
    for path in ROOT.glob(f"{folder}/**/*.py")
    if not any(part.startswith(".") for part in path.relative_to(ROOT).parts)  # the tools that interop/ installs
}


def _names(module: str) -> Iterator[str]:
    """The full name of all that a module imports, anywhere in it."""
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            outer = (*module.split("."), *(["__init__"] if FILES[module].name == "__init__.py" else []))
            base = ".".join([*(outer[: -node.level] if node.level else ()), *filter(None, [node.module])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _imports(module: str) -> set[str]:
    """The modules of this repository that a module imports; of a package that it imports from, the package."""
    found = set()
    for name in _names(module):
        while name and name not in FILES:
            name = name.rpartition(".")[0]  # noqa: PLW2901 (what is imported from a module is no module)
        found.add(name)
    return found - {"", module}


@pytest.fixture(scope="module")
def imports() -> dict[str, set[str]]:
    """Of every module."""
    return {module: _imports(module) for module in FILES}


def _part(module: str) -> str:
    return [*module.split("."), ""][1]


def test_the_imports_are_seen(imports: dict[str, set[str]]) -> None:
    assert imports["rov_fmu.build"] >= {"rov_fmu.export.archive", "rov_fmu.pages.fmu_page"}
    assert "rov_fmu.pages.report" in imports["rov_fmu.cli"], "inside a function"
    assert "rov_fmu.model.rov" in imports["rov_fmu.export.slave"], "from a package"
    assert {_part(module) for module in FILES if module.startswith("rov_fmu.")} == {*PARTS, "model", "__main__"}


def test_nothing_imports_in_a_circle(imports: dict[str, set[str]]) -> None:
    assert imports["rov_fmu"] == {"rov_fmu.interface.model"}, "which rov_fmu.load imports when it is called"
    try:
        TopologicalSorter(imports | {"rov_fmu": set()}).prepare()
    except CycleError as circle:
        pytest.fail(" < ".join(circle.args[1]))


def test_the_package_imports_downwards(imports: dict[str, set[str]]) -> None:
    below = {part: {part, *PARTS[n:], "model", ""} for n, part in enumerate(PARTS)}
    below |= {"model": {"model", ""}, "__main__": {"cli", "process"}, "": {"interface"}}
    upward = {
        f"{module} imports {name}"
        for module in FILES
        if module.split(".")[0] == "rov_fmu"
        for name in imports[module]
        if name.startswith("rov_fmu") and _part(name) not in below[_part(module)]
    }
    assert not upward


def test_the_files_of_the_package_know_nothing_of_the_model(imports: dict[str, set[str]]) -> None:
    assert not [m for m in FILES if _part(m) in ("files", "process") and any(_part(n) == "model" for n in imports[m])]


def test_the_model_imports_only_the_standard_library() -> None:
    modules = [module for module in FILES if module.startswith("rov_fmu.model")]
    assert modules
    outside = {name.split(".")[0] for module in modules for name in _names(module)} - {"rov_fmu"}
    assert outside <= sys.stdlib_module_names


@pytest.mark.parametrize("folder", AROUND)
def test_folders_import_what_they_may(folder: str) -> None:
    inner = {module for other in AROUND for module in _within(other) if other.startswith(f"{folder}/")}
    modules = _within(folder) - inner
    assert modules
    named = {name.split(".")[0] for module in modules for name in _names(module)}
    assert named & {*AROUND, "build_fmu"} <= AROUND[folder]


def _within(folder: str) -> set[str]:
    return {module for module, path in FILES.items() if ROOT / folder in path.parents}
