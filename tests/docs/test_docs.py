"""What README and documentation say holds: commands run, options exist, links lead somewhere, the site builds."""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from functools import cache
from importlib.util import find_spec
from io import BytesIO, StringIO, TextIOWrapper
from math import hypot, pi, sin
from pathlib import Path

import pytest

from docs import compared, reference
from rov_fmu import __version__
from rov_fmu.cli import _commands, main
from rov_fmu.equation.catalogue import ARM, AXIS, BODY, CURVE, TUNING
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle
from tests.commands import ROOT, Capsys
from tests.docs.test_notebooks import NOTEBOOKS
from tests.often import spread
from tests.vehicles import SIX, VEHICLES, tied

State = dict[str, float]

WEEKLY = ".github/workflows/weekly.yml"
README, CHANGELOG = ROOT / "README.md", ROOT / "CHANGELOG.md"
PAGES = [
    *(README, CHANGELOG, *(ROOT / f"{name}.md" for name in ("CONTRIBUTING", "CODE_OF_CONDUCT", "SECURITY"))),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "models").rglob("README.md")),
    *sorted((ROOT / "examples").rglob("README.md")),
    *sorted((ROOT / "verification").glob("*/README.md")),
]
PROGRAMS = ("rov-fmu ", "python build_fmu.py", "python -m ")
HOLDS_COMMANDS = re.compile(r"(?:rov-fmu|fmpy|cat|mkdir|python -m examples\.(?:tank_tests|dive_log)) ")
HERE_DOCUMENT = re.compile(r"(?<=<<END\n).*?^END$", re.MULTILINE | re.DOTALL)


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of a language, and the cells of a notebook that hold commands."""
    text = page.read_text(encoding="utf-8")
    cells = r"|\{code-cell\} ipython3\n%%sh" if language == "sh" else ""
    return re.findall(rf"^```(?:{language}{cells})\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def lines(block: str) -> list[str]:
    """The commands of a block, without the files they make."""
    return HERE_DOCUMENT.sub("", block).replace("\\\n", " ").strip().splitlines()


def runnable(page: Path) -> list[str]:
    """The blocks that need neither network nor anything installed but this package."""
    return [
        block for block in blocks(page, "sh") if all(HOLDS_COMMANDS.match(line) for line in filter(None, lines(block)))
    ]


def commands(page: Path) -> Iterator[list[str]]:
    """The words of every command of ours, in blocks and in running text."""
    inline = re.findall(r"(?<!`)`([^`\n]+)`(?!`)", page.read_text(encoding="utf-8"))
    for line in [*inline, *(line for block in blocks(page, "sh") for line in lines(block))]:
        for command in line.split("#")[0].split("&&"):
            if command.strip().startswith(PROGRAMS) and "|" not in command and "<" not in command:
                yield shlex.split(command)


@cache
def usage(command: tuple[str, ...]) -> str:
    """What --help says."""
    if command[1:2] == ("rov_fmu",) or command == ("build_fmu.py",):
        said = StringIO()
        with redirect_stdout(said):
            assert main([*(command[2:] or ["build"]), "--help"]) == 0
        return said.getvalue()
    # in this process, which has imported most of what they need
    printed, code = BytesIO(), None
    text = TextIOWrapper(printed, encoding="utf-8", write_through=True)
    with warnings.catch_warnings(), redirect_stdout(text), pytest.MonkeyPatch.context() as patched:
        warnings.simplefilter("ignore", RuntimeWarning)  # that it is imported already
        patched.setattr("sys.argv", [command[1], "--help"])
        try:
            runpy.run_module(command[1], run_name="__main__")
        except SystemExit as end:
            code = end.code
    assert not code
    return printed.getvalue().decode()


OF_OMSIMULATOR = "from OMSimulator import"


def module_of(words: Sequence[str]) -> tuple[tuple[str, ...], Sequence[str]]:
    """What to ask for help, and the words after it."""
    if words[0] == "rov-fmu":
        subcommand, rest = words[1:2], words[2:]
        return ("-m", "rov_fmu", *(subcommand if subcommand and subcommand[0][0] != "-" else ())), rest
    if words[1] == "build_fmu.py":
        return ("build_fmu.py",), words[2:]
    return ("-m", words[2]), words[3:]


def test_every_page_is_in_one_part() -> None:
    parts = re.findall(r":caption: (.*?)\n\n(.*?)```", (ROOT / "docs" / "index.md").read_text("utf-8"), re.DOTALL)
    assert [part for part, _ in parts] == ["Install", "Tutorials", "How-to", "Reference", "Explanation", "Project"]
    named = [page for _, pages in parts for page in pages.split()]
    pages = [page.stem for page in (ROOT / "docs").iterdir() if page.suffix in (".md", ".rst")]
    assert sorted([*named, "index"]) == sorted(pages)


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=name)
def test_the_first_sentence_of_a_page_says_for_whom_it_is(page: Path) -> None:
    """It follows the heading and a picture. Pages that show a file at the top of the repository have its own."""
    shown = re.sub(r"\A---.*?^---\n|^(#|!\[)[^\n]*", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    assert shown.strip().startswith(("For ", "The site shows "))


def test_the_page_of_the_vehicles_says_how_far_they_are_off() -> None:
    _, *rows = compared.tables()["videoray_measured"]
    paper, refit = (max(abs(float(row[n].rstrip("%"))) for row in rows) for n in (1, 2))
    text = " ".join((ROOT / "docs" / "vehicles.md").read_text(encoding="utf-8").split())
    assert (
        f"up to {paper:.0f} % off the steady velocities that the paper measured, and the refit is up to {refit:.0f} %"
        in text
    )


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_to_files(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8"))
    missing = [target for target in targets if "://" not in target and not (page.parent / target).exists()]
    assert not missing


@pytest.mark.parametrize("page", ["robustness", "extending", "architecture"])
def test_files_that_a_page_names_exist(page: str) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:rov_fmu|tests|fmu_src|verification|docs)/[\w./]+)`", text))
    assert named
    assert not [path for path in named if not (ROOT / path).exists()]


def test_every_module_of_tests_keeps_a_promise_that_the_page_has() -> None:
    """It is named there, or its folder is, and begins with its promise."""
    page = (ROOT / "docs" / "robustness.md").read_text(encoding="utf-8")
    named = {ROOT / path for path in re.findall(r"`(tests/[\w./]+)`", page)}
    modules = [*(ROOT / "tests").rglob("test_*.py")]
    assert [module for module in modules if not named & {module, *module.parents}] == []
    assert [module for module in modules if not module.read_text(encoding="utf-8").startswith('"""')] == []


@pytest.mark.parametrize("page", [page for page in PAGES if page != CHANGELOG], ids=name)
def test_commands_and_options_exist(page: Path) -> None:
    for words in commands(page):
        asked, rest = module_of(words)
        if asked[-1] == "venv":
            continue
        options = [word for word in rest if word.startswith("-")]
        if not options and asked[1:2] != ("rov_fmu",):
            assert asked == ("build_fmu.py",) or find_spec(asked[-1])
            continue  # a program that needs no options may do all its work when it is asked for help
        help_text = usage(asked)
        unknown = [word for word in options if not re.search(rf"(?<!\S){word}\b", help_text)]
        assert not unknown, f"{' '.join(words)}: {unknown}"


# ---- Run -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def workplace(tmp_path: Path, videoray_fmu: Path) -> Path:
    """What a reader has at hand: the FMU, a folder of tank tests, the command (it builds for this machine alone), and
    the plan that docs/system.md begins with."""
    plan, *_ = blocks(ROOT / "docs" / "system.md", "toml")
    (tmp_path / "tether.toml").write_text(plan, encoding="utf-8")
    shutil.copy(videoray_fmu, tmp_path)
    shutil.copytree(SHIPPED["videoray_refit"].parent / "tank_tests", tmp_path / "my_tests")
    shutil.copytree(ROOT / "examples" / "remus100", tmp_path / "examples" / "remus100")
    program = tmp_path / "bin" / "rov-fmu"
    program.parent.mkdir()
    program.write_text(
        "#!/usr/bin/env bash\n"
        'if [[ $1 = build && "$*" != *--platform* && "$*" != *--backend* ]]; then set -- "$@" --platform host; fi\n'
        f'exec "{sys.executable}" -m rov_fmu "$@"\n'
    )
    program.chmod(0o755)
    return tmp_path


def run(workplace: Path, *command: str) -> str:
    path = os.pathsep.join([str(workplace / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        command, cwd=workplace, env=environment, capture_output=True, text=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _lines_of(pages: Sequence[Path]) -> set[str]:
    """All command lines of these pages, without comments."""
    return {line.split("#")[0].strip() for page in pages for block in runnable(page) for line in lines(block)}


STOPPING = ROOT / "docs" / "tutorial-stopping-distance.md"
SENSORS = ROOT / "docs" / "sensors.md"
"""Their commands are run where their results are looked at, in test_tutorials.py and test_sensors.py."""
SHELL_PAGES: list[Path] = []
for one in PAGES:
    if one not in (*NOTEBOOKS, STOPPING, SENSORS) and not _lines_of([one]) <= _lines_of(SHELL_PAGES):
        SHELL_PAGES.append(one)
"""The pages with a command that no page before them has."""
AT_EACH_SUBMISSION = [README, ROOT / "docs" / "system.md"]
"""The first commands of a newcomer, and those with the most parts."""


@pytest.mark.skipif(sys.platform == "win32", reason="the pages' commands are written for a POSIX shell")
@pytest.mark.parametrize("page", spread(SHELL_PAGES, (), AT_EACH_SUBMISSION), ids=name)
def test_commands_run(page: Path, workplace: Path) -> None:
    for block in runnable(page):
        run(workplace, "bash", "-euc", block)


@pytest.mark.long
@pytest.mark.filterwarnings("default:.*commands saturate")
@pytest.mark.parametrize("page", [page for page in PAGES if "print(" in "".join(blocks(page, "python"))], ids=name)
def test_programs_print_what_is_said(
    page: Path, workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    """They run in this process, which has imported most of what they need.

    A class that becomes an FMU prints nothing; what it does is looked at beside the system that it is for.
    """
    monkeypatch.chdir(workplace)
    sentences = 0
    for program in blocks(page, "python"):
        if OF_OMSIMULATOR in program and find_spec("OMSimulator") is None:
            continue  # its package fetches its binaries as it is installed; another test looks at what it prints
        exec(compile(program, page.name, "exec"), {"__name__": "__main__"})
        printed = capsys.readouterr().out.splitlines()
        said = re.findall(r"^ *print\(.*?  # (.*)$", program, re.MULTILINE)
        sentences += len(said)
        for line, expected in zip(printed, said, strict=True):
            if line != expected:
                value = re.search(r"\d+\.(\d+) ", expected)
                assert value, "a sentence that ends with a number and its unit"
                assert f"{float(line):.{len(value[1])}f}" == value[0].strip()
    assert sentences > 0, "a page whose programs print nothing shows nothing"


def course(
    rov: Vehicle, command: Callable[[float], Mapping[str, float]], seconds: float, h: float, at: float
) -> list[State]:
    """The states from rest after each 0.1 s, the command of a step taken at a fraction of it."""
    state, rows = dict.fromkeys(rov.layout.state, 0.0), []
    rest = dict.fromkeys(rov.layout.inputs, 0.0)
    for n in range(round(seconds / h)):
        state = rov.step({**rest, **command((n + at) * h)}, state, h)
        rows.append(state)
    return rows[round(0.1 / h) - 1 :: round(0.1 / h)]


def test_the_first_simulations_end_where_the_pages_say(vehicle: Vehicle) -> None:
    readme, drive = (page.read_text(encoding="utf-8") for page in (README, ROOT / "docs" / "drive.md"))
    (*_, ahead) = course(vehicle, lambda _: {"u_l": 0.3, "u_r": 0.3}, 10.0, 0.1, 0.0)
    assert f"ends at u = {ahead['u']:.4f} m/s" in readme
    untuned = vehicle.with_(alpha_w=1.0, beta_w=1.0)
    (*_, down) = course(untuned, lambda _: {"u_t": 0.3}, 20.0, 0.1, 0.0)
    assert f"positive down: {down['w']:.4f} m/s" in drive
    (*_, down) = course(vehicle, lambda _: {"u_t": 0.3}, 10.0, 0.1, 0.0)
    assert f'm")  # {down["z"]:.4f} m\n' in drive, "the program for OMSimulator"


def test_held_commands_err_as_told(vehicle: Vehicle) -> None:
    """Against steps a tenth as long, fed with the middle: their error is a hundredth of that."""

    def winding(t: float) -> dict[str, float]:
        turn = 0.4 * sin(2.0 * pi * t / 20.0)
        return {"u_l": 0.5 + turn, "u_r": 0.5 - turn}

    true = course(vehicle, winding, 20.0, 0.01, 0.5)
    told = (ROOT / "docs" / "drive.md").read_text(encoding="utf-8")
    for what, at, digits in (("start", 0.0, 3), ("middle", 0.5, 4)):
        rows = course(vehicle, winding, 20.0, 0.1, at)
        pairs = list(zip(rows, true, strict=True))
        off = max(hypot(a["x"] - b["x"], a["y"] - b["y"]) for a, b in pairs)
        in_r = max(abs(a["r"] - b["r"]) for a, b in pairs)
        assert f"| that of its {what} | {1000.0 * off:.0f} mm | {in_r:.{digits}f} rad/s |" in told


# ---- What is said elsewhere too --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", VEHICLES)
def test_every_variable_is_told(kind: str) -> None:
    table = (ROOT / "docs" / "variables.md").read_text(encoding="utf-8")
    layout = VEHICLES[kind].layout
    known = {
        "thruster": {thruster.name for thruster in layout.thrusters} | set(layout.mix),
        "curve": {curve.name for curve in layout.curves},
        "axis": set("uvwr"),
    }
    told = {name for name in re.findall(r"`([^`]+)`", table) if "<" not in name}
    for pattern, of in re.findall(r"`([^`<]+)<(thruster|curve|axis)>`", table):
        told |= {f"{pattern}{name}" for name in known[of]}
    names = {*layout.inputs, *layout.state, *layout.calculated, *layout.coefficients}
    assert {name.removesuffix("_reverse") for name in names} <= told


def test_the_page_tells_which_parameters_are_tunable() -> None:
    page = (ROOT / "docs" / "variables.md").read_text(encoding="utf-8")
    told = dict[str, bool]()
    for names, what in re.findall(r"^\| (`[^|]+) \| ([^|]+) \|", page.partition("| parameter |")[2], re.MULTILINE):
        for name in re.findall(r"`([^`]+)`", names):
            told[re.sub("<.*>", ".+", name)] = "; tunable" in what or (name[:3] == "k_t" and "(tunable)" in what)
    for rov in (*VEHICLES.values(), tied(SIX, hook=(0.1, 0.2, 0.3))):
        for name, declared in rov.layout.coefficients.items():
            told_of = {is_tunable for pattern, is_tunable in told.items() if re.fullmatch(pattern, name)}
            assert told_of in ({declared.tunable}, set()), name


def test_tables_that_follow_from_the_code_are_as_it_has_them() -> None:
    """`python -m docs.reference` writes them."""
    pages = {page: page.read_text(encoding="utf-8") for page in reference.PAGES}
    assert [page for page, text in pages.items() if text != reference.filled(text)] == []
    tables = {**reference.tables(), **compared.tables()}
    assert [name for name in tables if f"<!-- table: {name} -->\n\n|" not in "".join(pages.values())] == []


def test_version_is_that_of_the_package() -> None:
    """A state in development names the release that it becomes, and is cited as the one before."""
    newest, *older = re.findall(r"^## (.*)$", CHANGELOG.read_text(encoding="utf-8"), re.MULTILINE)
    coming, dot, _ = __version__.partition(".dev")
    released = older[0] if dot else newest
    assert newest.startswith(f"[Unreleased] – {coming}" if dot else f"[{coming}] – ")
    cited = re.fullmatch(r"\[(.*)\] – (\d{4}-\d\d-\d\d)", released)
    assert cited
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f'\nversion: {cited[1]}\ndate-released: "{cited[2]}"\n' in citation


def test_every_set_of_tests_and_the_commands_of_the_readme_are_run_and_told() -> None:
    """The long tests, the importers and the site on every change, the exhaustive tests every week."""
    every_change, weekly, workflow = (
        (ROOT / name).read_text(encoding="utf-8") for name in (".ci/run", WEEKLY, ".github/workflows/test.yml")
    )
    assert all(f"\npytest -rs -m {marker}" in every_change for marker in ("long", '"interop and not weekly"'))
    assert "- run: python -m verification.weekly ${{ matrix.part }}" in weekly
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert all(f"`pytest -m {marker}`" in contributing for marker in ("long", "interop", "weekly"))
    for line in lines(blocks(README, "sh")[1]):
        assert f"- run: {line.split('#')[0].strip()}\n" in workflow
    alone = '- run: pip install -e ".[docs]" && sphinx-build -W docs site\n'
    assert alone in workflow.partition("\n  documentation:")[2].partition("[test]")[0], "with the notebooks executed"
    assert "begin_beside site sphinx-build -W docs site" in every_change


@pytest.mark.long
@pytest.mark.skipif(not (ROOT / "site").exists(), reason="CONTRIBUTING.md says how to build the site")
def test_the_site_is_complete_and_fetches_nothing() -> None:
    folder = ROOT / "site"
    pages = {page.name: page.read_text(encoding="utf-8") for page in folder.glob("*.html")}
    assert {f"{page.stem}.html" for page in (ROOT / "docs").glob("*.md")} <= set(pages)
    assert "ends at u = 0.4729 m/s" in pages["index.html"], "the README is the first page"
    flown = re.findall(r'(?:href|src)="(fly/[^"]+)"', pages["index.html"])
    vehicles = ["videoray.html", "bluerov2_heavy.html"]
    assert {place + name for place in ("fly/", "fly/compact/") for name in vehicles} == {*flown}
    assert all("live-vehicles" in (folder / page).read_text(encoding="utf-8") for page in flown)
    drawn = re.findall(r'src="_images/([^"]+)\.svg"', pages["vehicles.html"])
    assert {name for name in SHIPPED if name != "videoray_refit"} == {*drawn}
    assert {*_commands.commands} <= {*re.findall(r">rov-fmu</span> <span class=\"pre\">(\w+)<", pages["cli.html"])}
    assert {f"{page.stem}.ipynb" for page in NOTEBOOKS} == {page.name for page in folder.glob("_downloads/*/*.ipynb")}
    for key in (*BODY, *ARM, *CURVE, *AXIS, *TUNING):
        assert f">{key}</span>" in pages["vehicle-file.html"]
    for title, page in pages.items():
        assert "The site shows" not in page, title
        assert not re.findall(r'<(?:script|img|iframe)[^>]*src="(?:https?:)?//|<link[^>]*href="(?:https?:)?//', page), (
            title
        )
