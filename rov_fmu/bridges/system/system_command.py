"""The command `rov-fmu system`: a plan becomes an SSP, which is run; the companions are listed."""

from pathlib import Path

from rov_fmu.bridges.system.companion import COMPANIONS, lack, slave_of
from rov_fmu.bridges.system.plan import load_system_plan
from rov_fmu.bridges.system.run import picture, recorded, run_system, table
from rov_fmu.bridges.system.ssp import is_unchanged, ssp_content
from rov_fmu.bridges.system.system import files_of, made, unconnected
from rov_fmu.io.file_kinds import SYSTEM
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report import console
from rov_fmu.report.progress import parts


def write_system(path: Path, output: Path, *, runs: bool, force: bool) -> None:
    """Write the SSP of a plan; `runs`: run it, and write the motion as .csv and .svg beside it.

    Raises SystemPlanError, FileError, BuildError, WriteError. After a failure, no file is written.
    """
    results = [output.with_suffix(suffix) for suffix in (".csv", ".svg")] if runs else []

    def is_ours(file: Path) -> bool:
        return file == output and is_unchanged(file)

    check_targets([(output, SYSTEM), *((file, "") for file in results)], [path], force=force, is_ours=is_ours)
    plan = load_system_plan(path)
    with parts() as shown:
        structure = made(plan, path, lambda name: shown.begin(f"making {name}"))
        for sentence in unconnected(plan, structure):
            shown.print(sentence)
        outputs = [Output(output, ssp_content(files_of(plan, structure, output.stem)))]
        if runs:
            read = list(dict.fromkeys([*recorded(structure), *plan.plotted]))
            rows = run_system(structure, path, read, plan.step, plan.steps, shown.begin("running"))
            motion, plot = results
            drawing = picture(structure, read, plan.plot, plan.step, rows)
            outputs += [
                Output(motion, table(read, plan.step, rows)),
                Output(plot, sealed(drawing, "system").encode()),
            ]
    files = write_whole(*outputs, force=force, is_ours=is_ours)
    console.print_end(files, "open the plot" if runs else "open it in a co-simulation tool, or add --run")


def list_companions() -> None:
    """Print the companions with their variables."""
    for name in COMPANIONS:
        slave = slave_of(name)
        title = f"{name}: {slave.description}"
        if reason := lack(name):
            title += f"; {reason}"
        groups = [*(terminal for terminal, _ in getattr(slave, "terminals", ())), *getattr(slave, "points", ())]
        if groups:
            title += f". Terminals: {', '.join(groups)}"
        shown = console.table(title, "variable", ["start"], ["unit", "causality", "description"])
        for variable, (causality, start, unit, text) in slave.variables.items():
            shown.add_row(variable, f"{start:g}", unit, causality, text)
        console.print_table(shown)
