"""The importers of importers.toml: the command, the tolerance and the installed files of each."""

import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rov_fmu.equation.layout import Layout
from rov_fmu.io.messages import FileError
from rov_fmu.io.toml_file import Toml, read_toml

VERSIONS = (2, 3)
"""The versions of FMI."""
HERE = Path(__file__).parent
RUNNERS = HERE / "runners"

EXACT = 1e-9
"""The tolerance when the FMU itself takes the steps."""
_EULER = 1e-3
"""The tolerance of forward Euler with steps of 0.1 ms."""
_EULER_LAGGING = 1e-2
"""The tolerance of forward Euler when thrust lags.

After a jump of the command its error of the force is at most h ΔF / (2 e T), which is 7e-3 N for 58 N and a lag of
0.15 s.
"""
_TOLERANCES: Mapping[str, float | None] = {
    "exact": EXACT,
    "solver": 1e-5,  # of a solver with error control, in Model Exchange
    "single": 2e-6,  # of outputs in single precision: half a unit in the last place of numbers up to 64
    "Euler": _EULER,
    "only checks": None,
}
_KITS: Mapping[str, Toml] = {
    "python": {
        "pin": "requirements.txt",
        "proof": "{environment}/lib/python3*/site-packages/{module}-{version}.dist-info",
        "command": ["{tools}/{environment}/bin/python", "-m", "verification.interoperability.runners.{program}"],
    },
    "java": {
        "pin": "runners/{program}/pom.xml",
        "proof": "java/{program}/{package}-{version}.jar",
        "command": ["java", "-cp", "{tools}/java/{program}/*", "{runners}/{program}/Fly.java"],
    },
    "rust": {
        "pin": "runners/{module}/Cargo.toml",
        "proof": "rust/{package}-{version}/debug/fly",
        "command": ["{tools}/rust/{package}-{version}/debug/fly"],
    },
}
"""What importers have in common that are installed in the same way."""


@dataclass(frozen=True)
class Importer:
    """One row of the matrix. Names in braces are filled in."""

    name: str
    """The name on the command line."""
    title: str
    interface: str
    kit: str
    """The kit that installs it: python, java or rust."""
    package: str
    """The name of what is installed."""
    program: str
    """Its program or folder among the runners."""
    pin: str
    """The file that pins the version."""
    proof: str
    """A file among the tools that exists when this version is installed."""
    command: Sequence[str]
    """The command, to run in a folder with rov.fmu and the manoeuvre."""
    arguments: Sequence[str] = ()
    tolerance: float | None = EXACT
    """The tolerance of outputs at communication points (SI units); None when the importer only checks the FMU."""
    needs: Sequence[str] = ()
    """The programs of the system that it needs besides those of its kit."""
    fmi: int = 2
    """The version of the FMU that it loads."""
    has_discrete_inputs: bool = True
    """False for an importer that does not set inputs that change in events at their time. A vehicle with a dead time
    needs them: Model Exchange has to have events at the jumps, and fmi-sim sets such an input one row too late."""

    @property
    def pin_file(self) -> str:
        """The file that pins the version."""
        return self.pin.format(program=self.program, module=self.package.replace("-", "_"))

    @property
    def version(self) -> str:
        """The pinned version."""
        return pinned(self.pin_file, self.package)

    def suits(self, layout: Layout) -> bool:
        """Return True when it can fly a vehicle in its mode."""
        return self.has_discrete_inputs or not layout.has_dead_time

    def tolerance_for(self, layout: Layout) -> float | None:
        """Return the tolerance for a vehicle, which is larger for forward Euler if its thrust lags."""
        return _EULER_LAGGING if self.tolerance == _EULER and layout.lagging else self.tolerance

    def is_installed(self, tools: Path) -> bool:
        """Return True when this version is installed among the tools."""
        return any(tools.glob(self._filled(self.proof, tools)))

    def command_line(self, tools: Path) -> list[str]:
        """Return the command with all paths filled in."""
        return [self._filled(part, tools) for part in (*self.command, *self.arguments)]

    def _filled(self, text: str, tools: Path) -> str:
        return text.format(
            package=self.package,
            module=self.package.replace("-", "_"),
            program=self.program,
            version=self.version,
            environment=environment(self.pin),
            tools=tools,
            runners=RUNNERS,
            python=sys.executable,
        )


def pinned(file: str, package: str) -> str:
    """Return the version of a package in a requirements.txt, pom.xml or Cargo.toml."""
    pattern = rf"^\W*(?:artifactId>)?{re.escape(package)}(?:==|</artifactId>\s*<version>|\s*=\s*\"=)([\w.]+)"
    match = re.search(pattern, (HERE / file).read_text(), re.MULTILINE)
    if match is None:
        raise LookupError(f"{file} does not pin {package}")
    return match[1]


def environment(requirements: str) -> str:
    """Return the folder among the tools for the packages of a requirements file."""
    return requirements.replace("requirements", "python").removesuffix(".txt")


def _rows_of(row: Toml) -> Iterator[Importer]:
    """Yield an importer with an FMU of each version that it loads."""
    versions, tolerance = row.get("fmi", [2]), _TOLERANCES[row.get("tolerance", "exact")]
    for fmi in versions:
        other = ["fmi3"] if fmi == 3 and len(versions) > 1 else []
        name = "-".join([row["program"], *row.get("arguments", []), *other])
        yield Importer(**{**_KITS[row["kit"]], **row, "name": name, "fmi": fmi, "tolerance": tolerance})


IMPORTERS = [one for row in read_toml(HERE / "importers.toml", FileError)["importer"] for one in _rows_of(row)]
KITS = tuple(_KITS)


def chosen(names: list[str], versions: Collection[int] = VERSIONS) -> list[Importer]:
    """Return the importers of these names or kits (default: all) with these versions of FMI. Raises LookupError."""
    known = {*KITS, *(importer.name for importer in IMPORTERS)}
    if unknown := [name for name in names if name not in known]:
        raise LookupError(f"{unknown[0]}: no such importer; there are {', '.join(sorted(known))}")
    named = [i for i in IMPORTERS if not names or i.name in names or i.kit in names]
    if idle := set(names) - {name for i in named if i.fmi in versions for name in (i.name, i.kit)}:
        raise LookupError(f"{min(idle)}: not with this version of FMI")
    return [i for i in named if i.fmi in versions]
