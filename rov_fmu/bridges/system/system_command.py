"""The command `rov-fmu system`: a plan becomes an SSP, which is run; the companions are listed."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from rich.table import Table

from rov_fmu.autopilot.gains import STEP
from rov_fmu.bridges.system.companion import AUTOPILOT, COMPANIONS, OF_VEHICLES, SENSORS, lack, slave_of
from rov_fmu.bridges.system.companions._common import Variables
from rov_fmu.bridges.system.connections import SystemStructure
from rov_fmu.bridges.system.half_step import HalfStep, half_step
from rov_fmu.bridges.system.log import sensor_log
from rov_fmu.bridges.system.master import Name
from rov_fmu.bridges.system.plan import SystemPlan, SystemPlanError, load_system_plan
from rov_fmu.bridges.system.run import held_words, passed, picture, recorded_names, run_system, system_csv
from rov_fmu.bridges.system.ssp import ssp_content
from rov_fmu.bridges.system.system import elsewhere, files_of, made, of_vehicle, unconnected
from rov_fmu.fmu.archive import is_unchanged
from rov_fmu.fmus.instance import Array
from rov_fmu.io.file_kinds import SYSTEM
from rov_fmu.io.messages import FileError
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report import console
from rov_fmu.report.progress import Parts, parts
from rov_fmu.vehicle.shipped import find_vehicle, named_in
from rov_fmu.vehicle.vehicle import load_vehicle

_MOST_SHOWN = 10
"""The most variables of the table of what half the step changes."""


def write_system(path: Path, output: Path, *, runs: bool, force: bool) -> None:
    """Write the SSP of a plan; `runs`: run it, and write the motion as .csv and .svg beside it, and logs of sensors.

    Raises SystemPlanError, FileError, BuildError, WriteError. After a failure, no file is written.
    """
    results = [output.with_suffix(suffix) for suffix in (".csv", ".svg")] if runs else []

    def is_ours(file: Path) -> bool:
        return file == output and is_unchanged(file)

    targets = [(output, SYSTEM), *((file, "") for file in results)]
    check_targets(targets, [path], force=force, is_ours=is_ours)
    plan, half, changes = load_system_plan(path), None, None
    logs = {
        name: output.with_name(f"{output.stem}_{name}.csv")
        for name, table in plan.component.items()
        if runs and table.companion == SENSORS
    }
    targets += [(file, "") for file in logs.values()]
    check_targets(targets, _inputs(plan, path), force=force, is_ours=is_ours)
    with parts() as shown:
        structure = made(plan, path, lambda name: shown.begin(f"making {name}"))
        for sentence in (*unconnected(plan, structure), *elsewhere(structure)):
            shown.print(sentence)
        outputs = [Output(output, ssp_content(files_of(plan, structure, output.stem)))]
        if runs:
            read = list(dict.fromkeys([*recorded_names(structure), *plan.plotted]))
            begun = shown.begin("running")
            rows, warnings = run_system(structure, path, read, plan.step, plan.steps, begun, 1, plan.time_limit)
            for warning in warnings:
                shown.print(f"warning: {warning}")
            if words := held_words(structure, read, rows):
                shown.print(words)
            values = dict(zip(read, rows.T, strict=True))
            if passed(structure):
                half, changes = _half_step(structure, plan, path, values, shown)
            outputs += [Output(file, sensor_log(structure, name, values, plan.step)) for name, file in logs.items()]
            motion, plot = results
            drawing = picture(structure, read, plan.plot, plan.step, rows)
            outputs += [
                Output(motion, system_csv(read, plan.step, rows, half)),
                Output(plot, sealed(drawing, "system").encode()),
            ]
    files = write_whole(*outputs, force=force, is_ours=is_ours)
    if changes:
        console.print_table(changes)
    console.print_end(files, "open the plot" if runs else "open it in a co-simulation tool, or add --run")


def _half_step(
    structure: SystemStructure, plan: SystemPlan, path: Path, found: Mapping[Name, Array], shown: Parts
) -> tuple[HalfStep | None, Table | None]:
    """Return what half the step changes of the values `found`, also as a table. None, with a line, if it cannot run."""
    names = passed(structure)
    try:
        begun = shown.begin("running with half the step")
        halved = run_system(structure, path, names, plan.step, plan.steps, begun, 2, plan.time_limit)
    except FileError as error:
        shown.print(f"warning: with half the step: {error}")
        return None, None
    units = [structure.parts[component].variables[name].unit for component, name in names]
    half = half_step(np.array([found[name] for name in names]).T, halved.rows, units)
    order = np.argsort(-half.typical, kind="stable")[:_MOST_SHOWN]
    shown.print(half.words(names))
    columns = ["unit", "from", "to", "half the step changes it by up to", "root mean square of its range"]
    printed = console.table(
        f"step of {plan.step:g} s: the error is about twice what half the step changes", "variable", columns
    )
    for n in order:
        component, name = names[n]
        low, high = found[names[n]].min(), found[names[n]].max()
        numbers = (f"{low:.4g}", f"{high:.4g}", f"{half.largest[n]:.2g}", f"{half.typical[n]:.1%}")
        printed.add_row(f"{component}.{name}", units[n], *numbers)
    return half, printed


def _inputs(plan: SystemPlan, path: Path) -> Iterator[Path]:
    """Yield the files that a plan reads: itself, those that it names, and those of its vehicles."""
    yield path
    for name, one in plan.component.items():
        yield from (path.parent / file for file in (one.fmu, one.file) if file)
        for key, vehicle in (("vehicle", one.vehicle), ("coefficients", one.coefficients)):
            with suppress(FileError):  # `made` tells every mistake
                file = named_in(path, f"component.{name}.{key}", vehicle or "", SystemPlanError)
                yield from (file, *load_vehicle(file).files)


def _for_one(companion: str) -> Variables:
    """Return the variables of a companion for the vehicle that ships first; of gains, those in depth."""
    model = of_vehicle(companion, load_vehicle(find_vehicle("videoray")), STEP)
    return {
        one.name: (one.causality, one.start or 0.0, one.unit, one.description)
        for one in model.variables
        if one.causality in ("input", "output")
        or (one.causality == "parameter" and (companion != AUTOPILOT or one.name.endswith("_w")))
    }


def companions() -> dict[str, str]:
    """Return what each companion is, by its name."""
    return {name: OF_VEHICLES.get(name) or slave_of(name).description for name in COMPANIONS}


def list_companions() -> None:
    """Print the companions with their variables."""
    for name, words in companions().items():
        title = f"{name}: {words}"
        if name in OF_VEHICLES:
            title, variables = f"{title}, here for a VideoRay", _for_one(name)
        else:
            slave = slave_of(name)(instance_name=name)
            variables = slave.variables
            groups = [*(terminal for terminal, *_ in slave.terminals), *slave.points]
            title += f"; {reason}" if (reason := lack(name)) else ""
            title += f". Terminals: {', '.join(groups)}" if groups else ""
        shown = console.table(title, "variable", ["start"], ["unit", "causality", "description"])
        for variable, (causality, start, unit, text) in variables.items():
            shown.add_row(variable, f"{start:g}", unit, causality, text)
        console.print_table(shown)
