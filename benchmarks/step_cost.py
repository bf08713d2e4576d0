"""What fmi2DoStep costs in a plain C loop, by step size, straight and turning (Linux)."""

import asyncio
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.table import Table

from fmu_src.compile import PLATFORMS, compile_all, compiler, fmi_headers
from fmu_src.package import native_content
from models.vehicle import VIDEORAY, load_vehicle


def print_step_cost(console: Console) -> None:
    """Build the library and the loop, run it, print the table."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        console.print("fmi2DoStep in plain C: not measured, the loop is written for Linux on x86_64")
        return
    content = native_content(load_vehicle(VIDEORAY))
    with tempfile.TemporaryDirectory() as folder:
        library = f"{content.identifier}{PLATFORMS['linux64'].suffix}"
        built = asyncio.run(compile_all(["linux64"], content.sources, content.identifier))
        Path(folder, library).write_bytes(built["linux64"])
        source = Path(__file__).with_name("do_step.c")
        command = [*compiler(), "-target", *PLATFORMS["linux64"].targets, "-std=c11", "-O2"]
        flags = ["-I", str(fmi_headers()), str(source), f"./{library}", "-ldl", "-o", "do_step"]
        subprocess.run([*command, *flags], cwd=folder, check=True)
        run = ["./do_step", content.guid]
        output = subprocess.run(run, cwd=folder, check=True, capture_output=True, text=True)
    rows = [line.split() for line in output.stdout.splitlines()]
    sizes = list(dict.fromkeys(h for _, h, _, _ in rows))
    nanoseconds = {(name, h): float(time) for name, h, time, _ in rows}
    table = Table(title="fmi2DoStep, ns a step, median of 15 runs", title_justify="left")
    table.add_column("h (s)")
    for h in sizes:
        table.add_column(h, justify="right")
    for name in dict.fromkeys(name for name, *_ in rows):
        table.add_row(name.replace("-", " "), *(f"{nanoseconds[name, h]:.0f}" for h in sizes))
    console.print(table)
    console.print(f"allocations during the steps: {sum(int(count) for *_, count in rows)}", highlight=False)
