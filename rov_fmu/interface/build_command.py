"""Build an FMU with its progress on the terminal, and tell what was built, for `rov-fmu build`."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from rov_fmu.build import Built, build, chosen_platforms
from rov_fmu.io.messages import listed
from rov_fmu.report.console import console, paragraph, print_end, shell_words
from rov_fmu.report.progress import compiling
from rov_fmu.vehicle.vehicle import load_vehicle


def build_and_print(path: Path, platforms: Sequence[str], backend: str, fmi: int, **options: Any) -> None:
    """Build the FMU of a vehicle file. `options` are those of `build`. Raises what `build` raises."""
    started = perf_counter()
    vehicle = load_vehicle(path)
    chosen = chosen_platforms(platforms, fmi) if backend == "native" else []
    with compiling(chosen) as (begin, done):
        built = build(
            vehicle,
            platforms=chosen,
            backend=backend,
            fmi=fmi,
            inputs=[path],
            on_content=begin,
            on_compiled=done,
            **options,
        )
    _print_built(built, perf_counter() - started)


def _print_built(built: Built, seconds: float) -> None:
    """Print the size of the FMU and of its binaries, the times, what it did when it was run, and what to do next."""
    out = console()
    if built.lost:
        paragraph(out, f"Replaced {shell_words(built.path)}, which also had {listed(built.lost)}.")
    size = f"{built.size / 1000:.0f} kB, built in {seconds:.1f} s, GUID {built.guid}"
    paragraph(out, f"{shell_words(built.path)}: {size}")
    if len(built.binaries) > 1:
        paragraph(out, "The compilers ran in parallel. Each time is that from their start to the end of one:")
    for name, size_of_binary in built.binaries.items():
        out.print(f"  {name:<14}{size_of_binary / 1000:6.0f} kB{built.seconds[name]:7.1f} s")
    paragraph(out, built.note)
    following = shell_words("rov-fmu", "prove", built.path) if built.was_run else ""
    print_end([built.path, *built.beside], following)
