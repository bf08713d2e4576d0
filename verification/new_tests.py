"""python -m verification.new_tests OLD: which new tests pass on the product of an older commit, and so show no fault?

A test is new if the commit OLD does not have its id, in any set of tests. The new tests run in a temporary worktree of
OLD, in which `tests/` and `verification/` are those of this working tree. A test also counts as failing there if its
module cannot be imported, if it takes too long, or if its parameters do not exist there.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import click
import pytest

ROOT = Path(__file__).parents[1]
SUPPORT = ("tests", "verification")
"""The folders that support tests. They are replaced in the worktree of the old commit."""
LEFT_OUT = {
    "tests/frozen/": "they guard files that load today",
    "tests/verification/": "they test tools in verification/, which are replaced in the old commit too",
}
"""The folders whose new tests may pass on the old product, with the reason."""
FIRST_OF_OUTCOMES = ("failed", "skipped", "passed")
"""A test has the first of these that its setup, call and teardown have."""
_LONGEST = 120
"""The longest time (s) of one test."""
_LARGEST_FILE = 2 << 30
"""The largest file (bytes) of a test, because some tests show that the old product fills the disk."""
_NO_TESTS = 5
"""The exit code of pytest if it has collected no test."""
_PLUGIN, _SETTINGS = "plugin_of_new_tests", "NEW_TESTS"


# ---- The plugin, which runs in pytest --------------------------------------------------------------------------------


def _setting(name: str) -> str | None:
    value: str | None = json.loads(os.environ.get(_SETTINGS, "{}")).get(name)
    return value


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Ignore the modules without new tests."""
    if (wanted := _setting("wanted")) is None or not collection_path.match("test_*.py"):
        return None
    modules = {id_.partition("::")[0] for id_ in Path(wanted).read_text(encoding="utf-8").splitlines()}
    return True if collection_path.relative_to(Path.cwd()).as_posix() not in modules else None


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Write the ids of all tests, or keep only those that are wanted."""
    if ids := _setting("ids"):
        Path(ids).write_text("\n".join(item.nodeid for item in items), encoding="utf-8")
    if wanted := _setting("wanted"):
        keep = {*Path(wanted).read_text(encoding="utf-8").splitlines()}
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in keep])
        items[:] = [item for item in items if item.nodeid in keep]


def _note(outcome: str, id_: str) -> None:
    if (outcomes := _setting("outcomes")) and "PYTEST_XDIST_WORKER" not in os.environ:
        with Path(outcomes).open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps([outcome, id_])}\n")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _note(report.outcome, report.nodeid)


def pytest_collectreport(report: pytest.CollectReport) -> None:
    if report.failed:
        _note("not imported", report.nodeid)


# ---- The gate --------------------------------------------------------------------------------------------------------


@contextmanager
def worktree(commit: str, folder: Path) -> Iterator[Path]:
    """Check out a commit in a folder that does not exist yet, and remove it at the end."""
    git = ["git", "-C", str(ROOT), "worktree"]
    subprocess.run([*git, "add", "--quiet", "--detach", str(folder), commit], check=True)
    try:
        yield folder
    finally:
        subprocess.run([*git, "remove", "--force", str(folder)], check=True)


def environment(tree: Path, *further: Path) -> dict[str, str]:
    """Return the environment in which Python imports the package of a checkout, in child processes too."""
    own = {"PYTHONPATH": os.pathsep.join(map(str, [tree, *further]))}
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")} | own


def _pytest(tree: Path, plugin: Path, settings: dict[str, Path], arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start pytest in a checkout, with the configuration of this working tree."""
    own = json.dumps({name: str(path) for name, path in settings.items()})
    command = [sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tree)]
    with (plugin / f"{'-'.join(settings)} {tree.name}").open("wb") as output:
        return subprocess.Popen(
            [*command, "-p", "no:cacheprovider", "-p", _PLUGIN, *arguments, "tests"],
            cwd=tree,
            env=environment(tree, plugin) | {_SETTINGS: own},
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def _end_of(process: subprocess.Popen[bytes]) -> int:
    """Wait for a process, and end what its tests have left running."""
    try:
        return process.wait()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def copy_checkout(target: Path, *folders: str) -> Path:
    """Copy the files of the working tree that git does not ignore, or those in some folders, and return the target."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *folders]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
    for name in (name for name in names if (ROOT / name).is_file()):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target / name)
    return target


def _ids(old: Path, scratch: Path, marks: str) -> tuple[set[str], set[str]]:
    """Return the ids of all tests of the old commit, and those of the working tree in the chosen sets."""
    trees = {old: "", ROOT: marks}
    files = {tree: scratch / f"ids of {tree.name}" for tree in trees}
    running = [
        (tree, _pytest(tree, scratch, {"ids": files[tree]}, ["--collect-only", "-q", "-n", "0", "-m", chosen]))
        for tree, chosen in trees.items()
    ]
    for tree, process in running:
        if _end_of(process) not in (0, _NO_TESTS):
            raise click.ClickException(f"the tests cannot be collected:\n{(scratch / f'ids {tree.name}').read_text()}")
    before, now = ({*files[tree].read_text(encoding="utf-8").splitlines()} for tree in trees)
    return before, now


def outcomes(old: str, marks: str, processes: int, longest: int = _LONGEST) -> dict[str, str]:
    """Return the outcome of every new test on the product of an old commit."""
    with tempfile.TemporaryDirectory(prefix="new-tests-") as temporary:
        scratch = Path(temporary).resolve()
        shutil.copy(__file__, scratch / f"{_PLUGIN}.py")
        with worktree(old, scratch / "old") as tree:
            before, now = _ids(tree, scratch, marks)
            new = sorted(id_ for id_ in now - before if not id_.startswith((*LEFT_OUT,)))
            click.echo(f"{len(now)} tests, {len(new)} of them new since {old}", err=True)
            for folder, reason in LEFT_OUT.items():
                number = sum(id_.startswith(folder) for id_ in now - before)
                click.echo(f"left out: {number} new tests in {folder}, because {reason}", err=True)
            if not new:
                return {}
            (scratch / "wanted").write_text("\n".join(new), encoding="utf-8")
            for folder in SUPPORT:
                shutil.rmtree(tree / folder, ignore_errors=True)
            copy_checkout(tree, *SUPPORT)
            limits = ["-o", f"faulthandler_timeout={longest}", "-o", "faulthandler_exit_on_timeout=true"]
            limits += ["--max-worker-restart", f"{len(new)}", "--basetemp", str(scratch / "made by tests")]
            # A worker that a test crashes, or that ends because a test takes too long, is replaced by another one.
            workers = ["-n", f"{processes}", "-m", marks, "--continue-on-collection-errors"]
            settings = {"wanted": scratch / "wanted", "outcomes": scratch / "outcomes"}
            (scratch / "outcomes").touch()
            code = _end_of(_pytest(tree, scratch, settings, [*limits, *workers]))
            if code not in (0, 1, 2, _NO_TESTS):
                output = (scratch / "wanted-outcomes old").read_text(encoding="utf-8")
                raise click.ClickException(f"pytest cannot run on {old} (exit code {code}):\n{output}")
            noted = [json.loads(line) for line in (scratch / "outcomes").read_text(encoding="utf-8").splitlines()]
    by_id = {id_: {outcome for outcome, noted_id in noted if noted_id == id_} for _, id_ in noted}
    not_imported = {id_ for id_, found in by_id.items() if "not imported" in found}
    result = {}
    for id_ in new:
        of_phases = [outcome for outcome in FIRST_OF_OUTCOMES if outcome in by_id.get(id_, ())]
        absent = "not imported" if id_.startswith((*not_imported,)) else "not there"
        result[id_] = of_phases[0] if of_phases else absent
    return result


@click.command()
@click.argument("old")
@click.option("--long", is_flag=True, help="Run the new long tests too.")
@click.option("--processes", "-n", type=click.IntRange(1), default=2, show_default=True, help="Tests at once.")
def main(old: str, long: bool, processes: int) -> None:
    """Print the new tests that pass on the product of the commit OLD; exit with 1 when there are any."""
    import resource  # Windows does not have it

    resource.setrlimit(resource.RLIMIT_FSIZE, (_LARGEST_FILE, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    found = outcomes(old, "not weekly and not interop" + ("" if long else " and not long"), processes)
    for outcome in ("skipped", "not imported", "not there"):
        for id_ in (id_ for id_, its in found.items() if its == outcome):
            click.echo(f"{outcome}: {id_}", err=True)
    click.echo(", ".join(f"{number} {outcome}" for outcome, number in Counter(found.values()).items()), err=True)
    passed = [id_ for id_, outcome in found.items() if outcome == "passed"]
    click.echo("\n".join(passed) or f"no new test passes on {old}")
    sys.exit(1 if passed else 0)


if __name__ == "__main__":
    main()
