"""Run scenarios and print a table: python -m tests.identify.scenarios NAME ... --seeds N.

A name is that of a scenario or a part of it; without any, all scenarios are run. The judgement follows the table.
"""

from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np

from tests.identify.scenarios.catalogue import SCENARIOS
from tests.identify.scenarios.judge import band_widths, broken, promises
from tests.identify.scenarios.outcome import outcome

_ROW = "{:40} {:>9} {:>6} {:>6} {:>6}"


@click.command(help=__doc__)
@click.argument("names", nargs=-1)
@click.option("--seeds", default=2, show_default=True, help="The number of seeds.")
def main(names: tuple[str, ...], seeds: int) -> None:
    """Run the scenarios whose names contain one of the words; a whole name runs that scenario alone.

    The width of bands is the largest one over the axes and quantities.
    """
    chosen = [n for n in SCENARIOS if not names or any(w == n or (w not in SCENARIOS and w in n) for w in names)]
    if not chosen:
        raise click.UsageError(f"no such scenario, only: {', '.join(SCENARIOS)}")
    found = []
    click.echo(_ROW.format("scenario", "covered", "bands", "width", "CPU s"))
    for name in chosen:
        scenario = SCENARIOS[name]
        with TemporaryDirectory() as folder:
            outcomes = [outcome(scenario, seed, Path(folder) / str(seed)) for seed in range(seeds)]
        covered = [e.covered for o in outcomes for e in o.estimates]
        bands = [band.coverage for o in outcomes for band in o.bands]
        cells = (
            f"{sum(covered)}/{len(covered)}",
            f"{float(np.mean(bands)) if bands else nan:.0%}",
            f"{max(band_widths(outcomes).values(), default=nan):.2f}",
            f"{float(np.mean([o.seconds for o in outcomes])):.1f}",
        )
        click.echo(_ROW.format(name, *cells))
        found += [each.within(name) for each in promises(outcomes, scenario.expected)]
    failed = broken(found)
    click.echo("\n".join(["", *failed, f"{len(failed)} of {len(found)} promises are broken"]))


if __name__ == "__main__":
    main()
