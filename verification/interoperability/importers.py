"""The importers: the command, the tolerance and the installed files of each."""

import re
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from rov_fmu.equation.layout import Layout

VERSIONS = (2, 3)
"""The versions of FMI."""
HERE = Path(__file__).parent
RUNNERS = HERE / "runners"

EXACT = 1e-9
"""The tolerance when the FMU itself takes the steps."""
SOLVER = 1e-5
"""The tolerance of a solver with error control, in Model Exchange."""
SINGLE = 2e-6
"""The tolerance of outputs in single precision: half a unit in the last place of numbers up to 64."""
EULER = 1e-3
"""The tolerance of forward Euler with steps of 0.1 ms."""
EULER_LAGGING = 1e-2
"""The tolerance of forward Euler when thrust lags.

After a jump of the command its error of the force is at most h ΔF / (2 e T), which is 7e-3 N for 58 N and a lag of
0.15 s.
"""


@dataclass(frozen=True)
class Importer:
    """One row of the matrix."""

    name: str
    """The name on the command line."""
    title: str
    interface: str
    kit: str
    """The kit that installs it: python, java or rust."""
    pin: tuple[str, str]
    """The file that pins the version, and the package."""
    proof: str
    """A file among the tools that exists when this version is installed."""
    command: tuple[str, ...]
    """The command, to run in a folder with rov.fmu and the manoeuvre."""
    tolerance: float | None = EXACT
    """The tolerance of outputs at communication points (SI units); None when the importer only checks the FMU."""
    lagging_tolerance: float | None = None
    """The tolerance for a vehicle whose thrust lags behind the commands, when it is larger."""
    programs: tuple[str, ...] = ()
    """The programs of the system that it needs besides those of its kit."""
    fmi: int = 2
    """The version of the FMU that it loads."""
    has_discrete_inputs: bool = True
    """False for an importer that does not set inputs that change in events at their time. A vehicle with a dead time
    needs them: Model Exchange has to have events at the jumps, and fmi-sim sets such an input one row too late."""

    @property
    def version(self) -> str:
        """The pinned version."""
        return pinned(*self.pin)

    def suits(self, layout: Layout) -> bool:
        """Return True when it can fly a vehicle in its mode."""
        return self.has_discrete_inputs or not layout.has_dead_time

    def is_installed(self, tools: Path) -> bool:
        """Return True when this version is installed among the tools."""
        return any(tools.glob(self.proof.format(version=self.version)))

    def command_line(self, tools: Path) -> list[str]:
        """Return the command with all paths filled in."""
        paths = {"tools": tools, "runners": RUNNERS, "python": sys.executable}
        return [part.format(version=self.version, **paths) for part in self.command]


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


def _python(
    name: str,
    title: str,
    interface: str,
    package: str,
    tolerance: float | None = EXACT,
    programs: tuple[str, ...] = (),
    requirements: str = "requirements.txt",
) -> Importer:
    module, *arguments = name.split("-")
    place = environment(requirements)
    proof = f"{place}/lib/python3*/site-packages/{package.replace('-', '_')}-{{version}}.dist-info"
    command = f"{{tools}}/{place}/bin/python", "-m", f"verification.interoperability.runners.{module}", *arguments
    return Importer(
        name, title, interface, "python", (requirements, package), proof, command, tolerance, programs=programs
    )


def _java(
    name: str,
    title: str,
    interface: str,
    package: str,
    proof: str,
    command: tuple[str, ...],
    tolerance: float | None = EXACT,
) -> Importer:
    pin = f"runners/{name}/pom.xml", package
    return Importer(name, title, interface, "java", pin, f"java/{name}/{proof}", command, tolerance)


def _both(*importers: Importer) -> Iterator[Importer]:
    """Yield each importer with an FMU of FMI 2.0 and with one of FMI 3.0."""
    for importer in importers:
        yield from (importer, replace(importer, name=f"{importer.name}-fmi3", fmi=3))


def _without_events(importer: Importer) -> Importer:
    return replace(importer, has_discrete_inputs=False)


def _source(name: str, *options: str) -> tuple[str, ...]:
    return ("java", *options, "-cp", f"{{tools}}/java/{name}/*", f"{{runners}}/{name}/Fly.java")


def _rust(
    name: str,
    package: str,
    interface: str,
    tolerance: float = EXACT,
    lagging_tolerance: float | None = None,
    fmi: int = 2,
) -> Importer:
    pin = f"runners/{package.replace('-', '_')}/Cargo.toml", package
    proof = f"rust/{package}-{{version}}/debug/fly"
    command = f"{{tools}}/{proof}", *name.removeprefix(package).split("-")[1:]
    return Importer(name, package, interface, "rust", pin, proof, command, tolerance, lagging_tolerance, fmi=fmi)


_CARGO = "runners/fmu_runner/Cargo.toml"
_FMI_SIM = "rust/fmi-sim-{version}/bin/fmi-sim"

# Some importers are not in the table. FMI++ (fmipp 2.1.0) and mosaik-fmi 1.1.0, which uses it, have no binaries for
# Linux and compile with SUNDIALS 3 only. OMSimulator's package (3.0.0.post198) fetches its binaries from another host
# during its installation; tests/fmu/test_versions.py checks its rule for value references instead. Jaxonomy's Model
# Exchange agrees to 4e-6, but takes minutes. GEMSEO-FMU brings 1.1 GB of packages. moo-sim-interface holds all inputs
# at their start values, so it cannot fly a manoeuvre.
IMPORTERS = (
    *_both(
        _python("fmpy-cs", "FMPy", "CS, state restored", "fmpy"),
        _python("fmpy-me", "FMPy", "ME, CVode", "fmpy", SOLVER),
        _python("fmpy-compile", "FMPy", "CS, built by fmpy compile", "fmpy", programs=("cc", "c++", "make")),
    ),
    replace(_python("fmpy-events", "FMPy", "CS, Event Mode, steps end early", "fmpy"), fmi=3),
    _python("libcosim-cs", "libcosim", "CS", "libcosimpy"),
    _python("libcosim-ssp", "libcosim", "CS, SSP", "libcosimpy"),
    _python("libcosim-osp", "libcosim", "CS, OSP", "libcosimpy"),
    *_both(_python("ecos-cs", "Ecos", "CS", "ecospy")),
    _python("ecos-ssp", "Ecos", "CS, SSP", "ecospy"),
    *_both(
        _without_events(_python("casadi-me", "CasADi", "ME, DaeBuilder, CVODES", "casadi", SOLVER)),
        _python("pathsim-cs", "PathSim", "CS", "pathsim-fmi"),
        _without_events(_python("pathsim-me", "PathSim", "ME, RKDP87", "pathsim-fmi", SOLVER)),
    ),
    _python("jaxonomy", "Jaxonomy", "CS", "jaxonomy"),
    _python("cofmupy", "CoFmuPy", "CS", "cofmupy", requirements="requirements-cofmupy.txt"),
    *_both(_python("fmuloader", "fmuloader", "CS, state restored", "fmuloader")),
    _python("sofirpy", "SOFiRpy", "CS", "sofirpy"),
    _python("cosimtlk", "cosimtlk", "CS", "cosimtlk"),
    _python("syssimx", "SysSimX", "CS, ports with units", "syssimx"),
    _python("fmugym", "FMUGym", "CS, single precision", "fmugym", SINGLE),
    *_both(
        _python("fmucontainer", "fmutool", "CS, container of two ROVs", "fmu-manipulation-toolbox"),
        replace(
            _python("fmutool", "fmutool", "-check: schema, rules", "fmu-manipulation-toolbox", None),
            command=("{tools}/python/bin/fmutool", "-input", "rov.fmu", "-check"),
        ),
        _python("schemas", "lxml", "XML schemas", "lxml", None),
    ),
    _java("fmi4j", "FMI4j", "CS", "fmi-import", "fmi-import-{version}.jar", _source("fmi4j")),
    _java(
        "javafmi",
        "JavaFMI",
        "CS, state restored",
        "fmu-wrapper",
        "fmu-wrapper-{version}.jar",
        _source("javafmi", "--add-opens", "java.prefs/java.util.prefs=ALL-UNNAMED"),
    ),
    _java(
        "maestro",
        "Maestro",
        "CS, MaBL, state restored",
        "maestro",
        "maestro-{version}-jar-with-dependencies.jar",
        (
            "{python}",
            "-m",
            "verification.interoperability.runners.maestro.fly",
            "{tools}/java/maestro/maestro-{version}-jar-with-dependencies.jar",
        ),
    ),
    _java(
        "vdmcheck",
        "VDMCheck",
        "static rules",
        "vdmcheck2",
        "vdmcheck-{version}/VDMCheck2.sh",
        ("sh", "{runners}/vdmcheck/check.sh", "{tools}/java/vdmcheck/vdmcheck-{version}"),
        None,
    ),
    *_both(
        _without_events(
            Importer(
                "fmi-sim-cs",
                "fmi-sim",
                "CS",
                "rust",
                (_CARGO, "fmi-sim"),
                _FMI_SIM,
                ("sh", "{runners}/fmi_sim.sh", "cs"),
            )
        ),
        _without_events(
            Importer(
                "fmi-sim-me",
                "fmi-sim",
                "ME, forward Euler",
                "rust",
                (_CARGO, "fmi-sim"),
                _FMI_SIM,
                ("sh", "{runners}/fmi_sim.sh", "me"),
                EULER,
                EULER_LAGGING,
            )
        ),
    ),
    _rust("fmi-rs-cs", "fmi-rs", "CS, Event Mode", fmi=3),
    _without_events(_rust("fmi-rs-me", "fmi-rs", "ME, forward Euler", EULER, EULER_LAGGING, fmi=3)),
    _rust("fmu-runner", "fmu-runner", "CS, state restored"),
)

KITS = tuple(dict.fromkeys(importer.kit for importer in IMPORTERS))


def chosen(names: list[str], versions: Collection[int] = VERSIONS) -> list[Importer]:
    """Return the importers of these names or kits (default: all) with these versions of FMI. Raises LookupError."""
    known = {*KITS, *(importer.name for importer in IMPORTERS)}
    if unknown := [name for name in names if name not in known]:
        raise LookupError(f"{unknown[0]}: no such importer; there are {', '.join(sorted(known))}")
    named = [i for i in IMPORTERS if not names or i.name in names or i.kit in names]
    if idle := set(names) - {name for i in named if i.fmi in versions for name in (i.name, i.kit)}:
        raise LookupError(f"{min(idle)}: not with this version of FMI")
    return [i for i in named if i.fmi in versions]
