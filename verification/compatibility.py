"""python -m verification.compatibility FOLDER: what fmi-standard.org asks an exporting tool to publish.

For each vehicle that ships and for FMI 2.0 and 3.0 there is a folder with the FMU, its inputs, its reference solution,
the options, a Readme.txt and the report of a checker, as CONTRIBUTING.md of modelica/fmi-standard.org describes them
under "Compatibility information". Beside them stand tools.json, the entry of the list of tools, and README.md, the
importers with their versions.

At last, FMPy runs every FMU, and the results are compared with its reference solution.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from csv import QUOTE_NONNUMERIC
from importlib.metadata import metadata
from pathlib import Path

import click
import fmpy
import numpy as np
import pandas as pd
from fmpy.validation import validate_fmu

from rov_fmu import __version__
from rov_fmu.build import build_fmu
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import AXES, PITCH, ROLL
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.checkouts import ROOT
from verification.interoperability.manoeuvre import STEP, TIMES, Manoeuvre
from verification.interoperability.page import read_table

VERSIONS = (2, 3)
MOST_VARIABLES = 10
TOLERANCE = 1e-6
"""The tolerance of a comparison, relative to the largest value of a variable."""
_URLS = dict(text.split(", ", 1) for text in metadata("rov-fmu").get_all("Project-URL") or [])
_HOMEPAGE = _URLS.get("Homepage", "")
ENTRY = {
    "name": "rov-fmu",
    "license": "osi",
    "url": _HOMEPAGE,
    "logo": "",
    "vendor": "the rov-fmu authors",
    "vendorURL": _HOMEPAGE,
    "examplesURL": _URLS.get("Compatibility", ""),
    "description": "Identifies a model of an underwater vehicle (ROV) from tank tests and dive logs, and exports it",
    "features": [],
    "platforms": ["Linux", "macOS", "Windows"],
    "interfaces": ["CLI", "library"],
    "fmiVersions": ["2.0", "3.0"],
    "fmuExport": ["CS", "ME"],
    "fmuImport": [],
    "layeredStandards": ["REF"],
}
"""The entry in the list of tools. Its addresses are those of [project.urls] in pyproject.toml."""
PAGE = """# FMUs of rov-fmu {version}, and the importers that have run them

These pages are by the authors of rov-fmu, not by the Modelica Association. Each folder has an FMU, its inputs, and what
it computes from them. FMPy {fmpy} has checked and run them all. The table shows the largest difference of any output
from the step in Python, in SI units, in Co-Simulation (CS) and Model Exchange (ME).
{table}"""


README = """{name}

{about}.
The FMU (FMI {version}.0, Co-Simulation and Model Exchange) moves along these axes: {axes}.

Inputs are the commands of the thrusters, loads and a current. They are held over a step, and the motion of a
Co-Simulation step is exact to rounding, however long it is. So the reference solution holds for every step that
meets the changes of the inputs. This one was computed every {step} s.

What can be tested: Co-Simulation with a variable step; states that are saved, serialized and restored; directional
derivatives; tunable parameters; units and display units; terminals; and the layered standard FMI-LS-REF, whose
experiments stand inside the FMU.
"""


def manoeuvre(name: str) -> Manoeuvre:
    """Return the manoeuvre of a vehicle: all its axes that stay upright, one after the other and together."""
    axes = [name for name in load_vehicle(SHIPPED[name]).layout.by_name if AXES[name] not in (ROLL, PITCH)]
    phases = {2.0 + 4.0 * n: {axis: 0.2} for n, axis in enumerate(axes)}
    end = 2.0 + 4.0 * len(axes)
    return Manoeuvre(name, {}, {0.0: {}, **phases, end: dict.fromkeys(axes, -0.15), end + 6.0: {}})


def recorded(vehicle: Vehicle) -> list[str]:
    """Return the variables of the reference solution: velocities, position and attitude, at most ten."""
    layout = vehicle.layout
    names = [*layout.velocities, *(name for name in layout.pose if name not in QUATERNION), *layout.angles]
    return names[:MOST_VARIABLES]


def write(folder: Path, vehicles: Iterable[str] = tuple(SHIPPED), platforms: str | None = None) -> None:
    """Write the folders of some vehicles, the entry of the list of tools, and the page of the importers."""
    for name in vehicles:
        for version in VERSIONS:
            _write_fmu(folder / f"fmi{version}" / name, name, version, platforms)
    (folder / "tools.json").write_text(json.dumps([ENTRY], indent=4) + "\n", encoding="utf-8")
    table = read_table(ROOT / "docs" / "importers.md")
    page = PAGE.format(version=__version__, fmpy=fmpy.__version__, table=table)
    (folder / "README.md").write_text(page, encoding="utf-8")


def _write_fmu(folder: Path, name: str, version: int, platforms: str | None) -> None:
    folder.mkdir(parents=True)
    vehicle, flown = load_vehicle(SHIPPED[name]), manoeuvre(name)
    fmu = folder / f"{name}.fmu"
    build_fmu(vehicle, fmu, platforms=platforms, fmi=version)
    _write_csv(folder / f"{name}_in.csv", ["time", *vehicle.layout.inputs], flown.corners)
    names = ["time", *recorded(vehicle)]
    _write_csv(folder / f"{name}_ref.csv", names, [[row[key] for key in names] for row in flown.reference])
    options = {"StartTime": 0.0, "StopTime": TIMES[-1], "StepSize": STEP, "RelTol": TOLERANCE}
    lines = [f"{key}, {value}\n" for key, value in options.items()] + ["SolverType, FixedStep\n"]
    (folder / f"{name}_ref.opt").write_text("".join(lines), encoding="utf-8")
    problems = validate_fmu(str(fmu))
    report = [f"FMPy {fmpy.__version__}, validate_fmu: {len(problems)} problems", *problems]
    (folder / "fmpy-validate.txt").write_text("\n".join(report) + "\n", encoding="utf-8")
    axes = ", ".join(vehicle.layout.by_name)
    readme = README.format(name=vehicle.name, about=vehicle.description, version=version, axes=axes, step=STEP)
    (folder / "Readme.txt").write_text(readme, encoding="utf-8")


def _write_csv(path: Path, names: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    """Write a table by the CSV rules: quoted names, and numbers as in C."""
    table = pd.DataFrame([*rows], columns=[*names], dtype=float)
    path.write_text(table.to_csv(index=False, quoting=QUOTE_NONNUMERIC, lineterminator="\n"), encoding="utf-8")


def wrong_results(folder: Path) -> Iterator[str]:
    """Yield a line for each variable that FMPy's run of the FMU computes differently."""
    name, options = folder.name, options_of(folder)
    reference = pd.read_csv(folder / f"{name}_ref.csv", index_col="time")
    result = fmpy.simulate_fmu(
        str(folder / f"{name}.fmu"),
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=np.genfromtxt(folder / f"{name}_in.csv", delimiter=",", names=True, deletechars=""),
        output=[*reference],
    )
    for column, expected in reference.items():
        off = float(np.abs(np.interp(reference.index, result["time"], result[column]) - expected).max())
        if off > options["RelTol"] * float(expected.abs().max()):
            yield f"{name}_ref.csv: {column} differs by {off:.2g} from the run of the FMU by FMPy"


def options_of(folder: Path) -> dict[str, float]:
    """Return the numbers of the options."""
    lines = (folder / f"{folder.name}_ref.opt").read_text(encoding="utf-8").splitlines()
    pairs = (line.split(", ") for line in lines)
    return {key: float(value) for key, value in pairs if key != "SolverType"}


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
def main(folder: Path) -> None:
    """Write all folders, and run the FMUs. The exit code is 1 if a result differs."""
    if folder.exists() and any(folder.iterdir()):
        raise click.UsageError(f"{folder}: must be empty or new")
    write(folder)
    fmus = sorted(folder.glob("fmi*/*"))
    if found := [f"{one.parent.name}/{line}" for one in fmus for line in wrong_results(one)]:
        raise click.ClickException("\n".join(found))
    click.echo(f"{folder}: {len(fmus)} FMUs, which FMPy runs as their reference solutions say")


if __name__ == "__main__":
    main()
