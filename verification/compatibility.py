"""python -m verification.compatibility FOLDER: what fmi-standard.org asks an exporting tool to publish.

For each vehicle that ships and for FMI 2.0 and 3.0 there is a folder with the FMU, its inputs, its reference solution,
the options, a Readme.txt and the report of a checker, as CONTRIBUTING.md of modelica/fmi-standard.org describes them
under "Compatibility information". Beside them stands tools.json, the entry of the list of tools.

`check` says where a folder breaks these rules, and how far FMPy's run of an FMU is from its reference solution.
"""

import csv
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import click
import fmpy
import numpy as np
from fmpy.validation import validate_fmu

from rov_fmu.build import build
from rov_fmu.c.simulation import Array
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import AXES, PITCH, ROLL
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.interoperability.manoeuvre import STEP, TIMES, Manoeuvre

VERSIONS = (2, 3)
MOST_VARIABLES = 10
MOST_BYTES = 1_000_000
TOLERANCE = 1e-6
"""The tolerance of a comparison, relative to the largest value of a variable."""
ENTRY = {
    "name": "rov-fmu",
    "license": "osi",
    "url": "",
    "logo": "",
    "vendor": "the rov-fmu authors",
    "vendorURL": "",
    "description": "Identifies a model of an underwater vehicle (ROV) from tank tests and dive logs, and exports it",
    "features": [],
    "platforms": ["Linux", "macOS", "Windows"],
    "interfaces": ["CLI", "library"],
    "fmiVersions": ["2.0", "3.0"],
    "fmuExport": ["CS", "ME"],
    "fmuImport": [],
    "layeredStandards": ["FMI-LS-REF"],
}
"""The entry in the list of tools. The addresses are entered when the project has a public one."""


README = """{name}

{about}.
The FMU (FMI {version}.0, Co-Simulation and Model Exchange) moves along these axes: {axes}.

Inputs are the commands of the thrusters, loads and a current. They are held over a step, and the motion of a
Co-Simulation step is exact to rounding for any length of the step. So the reference solution holds for every step that
meets the changes of the inputs. This one was computed every {step} s.

What can be tested: Co-Simulation with a variable step; states that are saved, serialized and restored; directional
derivatives; tunable parameters; units and display units; terminals; and the layered standard FMI-LS-REF, whose
experiments stand inside the FMU.
"""


def manoeuvre(name: str) -> Manoeuvre:
    """Return the manoeuvre of a vehicle: all its axes that stay upright, one after the other and together."""
    axes = [name for name in load_vehicle(SHIPPED[name]).layout.kinds if AXES[name] not in (ROLL, PITCH)]
    phases = {2.0 + 4.0 * n: {axis: 0.2} for n, axis in enumerate(axes)}
    end = 2.0 + 4.0 * len(axes)
    return Manoeuvre(name, {}, {0.0: {}, **phases, end: dict.fromkeys(axes, -0.15), end + 6.0: {}})


def recorded(vehicle: Vehicle) -> list[str]:
    """Return the variables of the reference solution: velocities, position and attitude, at most ten."""
    layout = vehicle.layout
    names = [*layout.velocities, *(name for name in layout.pose if name not in QUATERNION), *layout.angles]
    return names[:MOST_VARIABLES]


def write(folder: Path, vehicles: Iterable[str] = tuple(SHIPPED), platforms: str | None = None) -> None:
    """Write the folders of some vehicles, and the entry of the list of tools."""
    for name in vehicles:
        for version in VERSIONS:
            _write_fmu(folder / f"fmi{version}" / name, name, version, platforms)
    (folder / "tools.json").write_text(json.dumps([ENTRY], indent=4) + "\n", encoding="utf-8")


def _write_fmu(folder: Path, name: str, version: int, platforms: str | None) -> None:
    folder.mkdir(parents=True)
    vehicle, flown = load_vehicle(SHIPPED[name]), manoeuvre(name)
    fmu = folder / f"{name}.fmu"
    build(vehicle, fmu, platforms=platforms, fmi=version)
    starts = sorted(flown.phases)
    corners = [  # a held command is two rows at the same time, because importers interpolate linearly
        [time, *flown.inputs_at(start).values()]
        for start, end in zip(starts, [*starts[1:], TIMES[-1]], strict=True)
        for time in (start, end)
    ]
    _write_csv(folder / f"{name}_in.csv", ["time", *vehicle.layout.inputs], corners)
    names = ["time", *recorded(vehicle)]
    _write_csv(folder / f"{name}_ref.csv", names, [[row[key] for key in names] for row in flown.reference])
    options = {"StartTime": 0.0, "StopTime": TIMES[-1], "StepSize": STEP, "RelTol": TOLERANCE}
    lines = [f"{key}, {value}\n" for key, value in options.items()] + ["SolverType, FixedStep\n"]
    (folder / f"{name}_ref.opt").write_text("".join(lines), encoding="utf-8")
    problems = validate_fmu(str(fmu))
    report = [f"FMPy {fmpy.__version__}, validate_fmu: {len(problems)} problems", *problems]
    (folder / "fmpy-validate.txt").write_text("\n".join(report) + "\n", encoding="utf-8")
    (folder / "Readme.txt").write_text(_readme(vehicle, version), encoding="utf-8")


def _write_csv(path: Path, names: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    """Write a table by the CSV rules: quoted names, and numbers as in C."""
    lines = [",".join(f'"{name}"' for name in names), *(",".join(map(repr, map(float, row))) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _readme(vehicle: Vehicle, version: int) -> str:
    return README.format(
        name=vehicle.name, about=vehicle.description, version=version, axes=", ".join(vehicle.layout.kinds), step=STEP
    )


def check(folder: Path) -> Iterator[str]:
    """Yield a line for each rule that the folder of an FMU breaks; if it breaks none, run the FMU and compare."""
    broken = [*_form_mistakes(folder)]
    yield from broken or _run_mistakes(folder)


def _form_mistakes(folder: Path) -> Iterator[str]:
    """Yield a line for each rule about files and tables that a folder breaks."""
    name = folder.name
    needed = [f"{name}.fmu", f"{name}_ref.csv", f"{name}_in.csv", f"{name}_ref.opt", "Readme.txt"]
    if missing := [file for file in needed if not (folder / file).is_file()]:
        yield from (f"{file}: this file is missing" for file in missing)
        return
    description = fmpy.read_model_description(str(folder / f"{name}.fmu"))
    known = {variable.name: variable.causality for variable in description.modelVariables}
    for suffix in ("_ref.csv", "_in.csv"):
        yield from _table_mistakes(folder / f"{name}{suffix}", known, inputs=suffix == "_in.csv")
    options, time = _options(folder), _table(folder / f"{name}_ref.csv")[0]
    if (time[0], time[-1]) != (options["StartTime"], options["StopTime"]):
        yield f"{name}_ref.csv: must run from StartTime to StopTime of {name}_ref.opt"


def _run_mistakes(folder: Path) -> Iterator[str]:
    """Yield a line for each variable that FMPy's run of the FMU computes differently."""
    name, options = folder.name, _options(folder)
    time, reference = _table(folder / f"{name}_ref.csv")
    result = fmpy.simulate_fmu(
        str(folder / f"{name}.fmu"),
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=np.genfromtxt(folder / f"{name}_in.csv", delimiter=",", names=True, deletechars=""),
        output=[*reference],
    )
    for column, expected in reference.items():
        off = float(np.max(np.abs(np.interp(time, result["time"], result[column]) - expected)))
        if off > options["RelTol"] * float(np.max(np.abs(expected))):
            yield f"{name}_ref.csv: {column} differs by {off:.2g} from the run of the FMU by FMPy"


def _options(folder: Path) -> dict[str, float]:
    """Return the numbers of the options."""
    lines = (folder / f"{folder.name}_ref.opt").read_text(encoding="utf-8").splitlines()
    pairs = (line.split(", ") for line in lines)
    return {key: float(value) for key, value in pairs if key != "SolverType"}


def _table(path: Path) -> tuple[Array, dict[str, Array]]:
    """Return the times, and the values of each variable by name."""
    head, *lines = path.read_text(encoding="utf-8").splitlines()
    (names,) = csv.reader([head])
    time, *columns = np.array([line.split(",") for line in lines], float).T
    return time, dict(zip(names[1:], columns, strict=True))


def _table_mistakes(path: Path, known: dict[str, str], *, inputs: bool) -> Iterator[str]:
    """Yield a line for each rule that a CSV file breaks."""
    if path.stat().st_size > MOST_BYTES:
        yield f"{path.name}: must have at most {MOST_BYTES:,} bytes"
    head, *lines = path.read_text(encoding="utf-8").splitlines()
    (names,) = csv.reader([head])
    if head != ",".join(f'"{name}"' for name in names):
        yield f"{path.name}: all names must be in quotation marks"
    if names[0] != "time":
        yield f"{path.name}: the first column must be the time"
    if strange := [name for name in names[1:] if name not in known]:
        yield f"{path.name}: {strange[0]} is no variable of the FMU"
    if inputs and set(names[1:]) != {name for name, causality in known.items() if causality == "input"}:
        yield f"{path.name}: must have all inputs of the FMU"
    if not inputs and len(names) - 1 > MOST_VARIABLES:
        yield f"{path.name}: must have at most {MOST_VARIABLES} variables"
    rows = [[float(cell) for cell in line.split(",")] for line in lines]
    if any(len(row) != len(names) for row in rows):
        yield f"{path.name}: every row must have {len(names)} numbers"
    times = [row[0] for row in rows]
    if times != sorted(times):
        yield f"{path.name}: the times must not fall"


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
def main(folder: Path) -> None:
    """Write all folders and check them. The exit code is 1 if a rule is broken."""
    if folder.exists() and any(folder.iterdir()):
        raise click.UsageError(f"{folder}: must be empty or new")
    write(folder)
    fmus = sorted(folder.glob("fmi*/*"))
    if found := [f"{one.parent.name}/{line}" for one in fmus for line in check(one)]:
        raise click.ClickException("\n".join(found))
    click.echo(f"{folder}: {len(fmus)} FMUs, which FMPy runs as their reference solutions say")


if __name__ == "__main__":
    main()
