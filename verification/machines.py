"""python -m verification.machines: do results stay the same on another machine?

The known results of the tests and the identification of some folders are run once as they are here, and again with one
thing after another changed that differs between machines: the kernels of OpenBLAS and NumPy, threads, fused operations
of the filter, the last digits of the logs, language and time zone, the user, folders with spaces in their names, and
the number of cores. Verdicts, causes, sentences and refusals have to be the same, and numbers as close as a fit repeats
(tests/frozen/comparison.py). The exit code is 1 if anything differs.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import click
import numpy as np

from tests.commands import without_progress
from tests.frozen.comparison import differences
from tests.frozen.known import without_folder
from verification.checkouts import ROOT
from verification.identification.strangers.drawn import draw
from verification.identification.strangers.water import THRUSTERS

_SIMD = np.show_config(mode="dicts")["SIMD Extensions"]
_AVX_512 = " ".join(name for name in _SIMD["found"] if name.startswith(("AVX512", "X86_V4")))
_PLAIN = "import sys; sys.argv[0] = 'rov-fmu'; from rov_fmu.cli import main; sys.exit(main(sys.argv[1:]))"
_UNFUSED = (
    "from rov_fmu.c import compile, library; fused = compile.engine_flags\n"
    "def flags(*of): return [one.replace('contract=on', 'contract=off') for one in fused(*of)]\n"
    "compile.engine_flags = library.engine_flags = flags\n"
)
_NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d+(?![\w.])")
_LAST_DIGIT = 1e-15
_LONGEST = 1800.0
"""The longest time of one identification, s."""
_NOBODY = "65534"
"""The number of a user with no rights."""


@dataclass(frozen=True)
class Machine:
    """What another machine has, beside this one."""

    name: str
    variables: Mapping[str, str] = field(default_factory=dict)
    """Those of the environment."""
    prefix: Sequence[str] = ()
    """The program, with its options, that runs the command."""
    before: str = ""
    """What Python does before the command."""
    digits: bool = False
    """True if the numbers of each log differ in their last digit."""
    folder: str = "m"
    """The name of the folder that has its home, its temporary folder and what it identifies."""


def machines() -> Iterator[Machine]:
    """Yield this machine, and then the others that can be tried here."""
    yield Machine("this machine")
    for kernels in ("Nehalem", "Haswell", "SkylakeX"):
        yield Machine(f"OpenBLAS for {kernels}", {"OPENBLAS_CORETYPE": kernels})
    for threads in "12":
        yield Machine(f"OpenBLAS with {threads} threads", {"OPENBLAS_NUM_THREADS": threads})
    if _AVX_512:
        yield Machine("NumPy without AVX-512", {"NPY_DISABLE_CPU_FEATURES": _AVX_512})
    yield Machine("filter without fused operations", before=_UNFUSED)
    yield Machine("last digits of the logs", digits=True)
    yield Machine("language and time zone", {"LC_ALL": "C", "LANGUAGE": "de", "TZ": "Asia/Kathmandu"})
    yield Machine("folders with spaces", folder="m m")
    if shutil.which("taskset"):
        yield Machine("one core", prefix=("taskset", "-c", str(min(os.sched_getaffinity(0)))))
    if _is_root() and shutil.which("setpriv"):
        ids = (f"--reuid={_NOBODY}", f"--regid={_NOBODY}", "--clear-groups")
        yield Machine("a user who is not root", prefix=("setpriv", *ids))


def _is_root() -> bool:
    return sys.platform != "win32" and os.geteuid() == 0


# ---- What is identified ----------------------------------------------------------------------------------------------

DRAWN = ((21, 1), (22, 2), (23, 2), (24, 2), (25, 2), (26, 2), (28, 2), (30, 2))
"""Seeds and numbers of axes of vehicles that are drawn, half of which break the equation."""
UNRELATED = ((31, 1), (33, 1), (35, 2), (37, 2))
"""Those of which the logs have nothing to do with their commands."""
SAMPLE = ("OpenBLAS for Nehalem", "last digits of the logs", "folders with spaces")
_SAMPLE_FOLDERS = ("drawn 21", "unrelated 31")


def write_folders(into: Path) -> None:
    """Write all folders that are identified."""
    for seed, count in DRAWN:
        draw(seed, count).write(into / f"drawn {seed}")
    for seed, count in UNRELATED:
        draw(seed, count).write(folder := into / f"unrelated {seed}")
        for path in folder.glob("dive_*.csv"):
            head, *lines = path.read_text(encoding="utf-8").splitlines()
            rows = np.array([line.split(",") for line in lines])
            is_command = [any(name.startswith(f"{own} ") for own in THRUSTERS) for name in head.split(",")]
            rows[:, is_command] = rows[::-1, is_command]
            path.write_text("\n".join([head, *map(",".join, rows.tolist()), ""]), encoding="utf-8")


def _with_other_digits(folder: Path) -> None:
    """Change each number of the logs of a folder in its last digit."""
    random = np.random.default_rng(0)

    def other(number: re.Match[str]) -> str:
        return repr(float(number[0]) * (1.0 + _LAST_DIGIT * float(random.choice([-1.0, 1.0]))))

    for path in sorted(folder.glob("dive_*.csv")):
        head, *lines = path.read_text(encoding="utf-8").splitlines()
        path.write_text("\n".join([head, *(_NUMBER.sub(other, line) for line in lines), ""]), encoding="utf-8")


# ---- On one machine --------------------------------------------------------------------------------------------------


def place_of(machine: Machine, scratch: Path) -> Path:
    """Return the folder of a machine. Its path is short, because a long one breaks lines elsewhere."""
    return scratch / "".join(word[0] for word in machine.name.split()) / machine.folder


def run(machine: Machine, scratch: Path, program: str, *arguments: str) -> tuple[int, str]:
    """Run a program of Python on a machine, and return its exit code and what it prints."""
    places = {name: place_of(machine, scratch) / name[0] for name in ("HOME", "TMPDIR")}
    for place in places.values():
        place.mkdir(parents=True, exist_ok=True)
        if machine.prefix[:1] == ("setpriv",):
            os.chown(place, int(_NOBODY), int(_NOBODY))
    cache = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    own = {} if " " in machine.folder or "setpriv" in machine.prefix else {"XDG_CACHE_HOME": cache}
    variables = {**os.environ, **own, **{name: str(place) for name, place in places.items()}, **machine.variables}
    command = [*machine.prefix, sys.executable, "-c", machine.before + program, *arguments]
    done = subprocess.run(
        command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False, timeout=_LONGEST
    )
    return done.returncode, done.stdout + without_progress(done.stderr)


def identified(machine: Machine, folder: Path, scratch: Path) -> str:
    """Return what the identification of a folder prints and writes on a machine."""
    own = place_of(machine, scratch) / folder.name.replace(" ", "_")
    shutil.copytree(folder, own)
    if machine.digits:
        _with_other_digits(own)
    for path in (own, *own.iterdir()):
        path.chmod(0o777)  # for another user
    code, said = run(machine, scratch, _PLAIN, "identify", str(own), "-o", str(own / "found.toml"))
    written = own / "found.toml"
    text = written.read_text(encoding="utf-8") if written.exists() else ""
    text = re.sub(r"\b[0-9a-f]{64}\b", "", f"exit code {code}\n{said}\n{text}")
    return without_folder(text, str(own.parent))


def known_results(machine: Machine, scratch: Path, some: str) -> str:
    """Return which known results of the tests differ on a machine; nothing if none does."""
    words = ["-n", "0", "-p", "no:cacheprovider", "-m", "", "-k", some, "tests/frozen/test_known_results.py"]
    code, said = run(machine, scratch, f"import sys, pytest; sys.exit(pytest.main({words!r}))")
    return said if code else ""


def _judged(machine: Machine, usual: Mapping[str, str], found: Mapping[str, str], known: str) -> bool:
    """Print how what is told on a machine differs from the usual, and return whether anything does."""
    changes = {name: differences(usual[name], text, is_fit=True) for name, text in found.items()}
    flipped = [name for name, lines in changes.items() if lines]
    said = [*(["known results"] if known else []), *flipped]
    print(f"{machine.name}: {', '.join(said) or 'the same'}", flush=True)
    for name in flipped:
        print("\n".join([f"  {name}", *(f"    {line}" for line in changes[name])]))
    if known:
        print(known[-3000:])
    return bool(said)


@click.command()
@click.option("--sample", is_flag=True, help="Some machines, folders and known results, in about two minutes.")
@click.option("--only", multiple=True, help="The names of the machines.")
def main(sample: bool, only: Sequence[str]) -> None:
    """Run everything on each machine, and print what differs."""
    wanted = only or (SAMPLE if sample else ())
    others = [one for one in [*machines()][1:] if not wanted or one.name in wanted]
    here = next(machines())
    with tempfile.TemporaryDirectory(prefix="m-") as temporary, ThreadPoolExecutor(os.cpu_count()) as pool:
        scratch = Path(temporary)
        scratch.chmod(0o755)
        write_folders(scratch / "folders")
        folders = [one for one in sorted((scratch / "folders").iterdir()) if not sample or one.name in _SAMPLE_FOLDERS]

        def texts(machine: Machine) -> dict[str, str]:
            texts = pool.map(partial(identified, machine, scratch=scratch), folders)
            return dict(zip([folder.name for folder in folders], texts, strict=True))

        usual = texts(here)
        some = "stays and (tadpole or tables or report)" if sample else "stays"
        differ = [_judged(one, usual, texts(one), known_results(one, scratch, some)) for one in others]
    sys.exit(any(differ))


if __name__ == "__main__":
    main()
