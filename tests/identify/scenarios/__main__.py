"""Run scenarios and print a table: python -m tests.identify.scenarios NAME ... --seeds N.

A name is that of a scenario or a part of it; without any, all scenarios are run. The judgement follows the table.
"""

from collections.abc import Sequence
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np

from tests.identify.scenarios.catalogue import SCENARIOS
from tests.identify.scenarios.judge import band_widths, broken, by_number, promises, ratios_to_gate
from tests.identify.scenarios.outcome import Outcome, Row, outcome, read_gate, rows, write_rows
from tests.identify.scenarios.scenario import Expected

_HEADER = (
    f"{'scenario':40} {'covered':>9} {'bias':>7} {'/gate':>6} {'bands':>6} {'width':>6} {'false':>5} {'alarms':>6} "
    f"{'unusable':>8} {'refused':>7} {'CPU s':>6}"
)


@click.command(help=__doc__)
@click.argument("names", nargs=-1)
@click.option("--seeds", default=2, show_default=True, help="The number of seeds.")
@click.option("--csv", "table", type=click.Path(path_type=Path), help="Write the numbers of all seeds to this file.")
def main(names: tuple[str, ...], seeds: int, table: Path | None) -> None:
    """Run the scenarios whose names contain one of the words; a whole name runs that scenario alone."""
    chosen = {
        name: scenario
        for name, scenario in SCENARIOS.items()
        if not names or any(word == name or (word not in SCENARIOS and word in name) for word in names)
    }
    if not chosen:
        raise click.UsageError(f"no such scenario, only: {', '.join(SCENARIOS)}")
    gate, all_rows, all_promises = read_gate(), list[Row](), []
    click.echo(_HEADER)
    for name, scenario in chosen.items():
        with TemporaryDirectory() as folder:
            outcomes = [outcome(scenario, seed, Path(folder) / str(seed)) for seed in range(seeds)]
        click.echo(line(name, outcomes, scenario.expected, ratios_to_gate(name, outcomes, gate)))
        all_promises += [(name, promise) for promise in promises(name, outcomes, scenario.expected, gate)]
        all_rows += [row for n, o in enumerate(outcomes) for row in rows(name, n, o, scenario.expected.effects)]
        if table:  # after each scenario, so that a long run may be stopped
            write_rows(table, all_rows)
    failed = broken([each.within(name) for name, each in all_promises])
    click.echo("\n".join(["", *failed, f"{len(failed)} of {len(all_promises)} promises are broken"]))


def line(name: str, outcomes: Sequence[Outcome], expected: Expected, ratios: dict[str, float]) -> str:
    """Return the row of a scenario. Bias, width and the ratio to the gate are the largest ones over the numbers."""
    estimates = [e for o in outcomes for e in o.estimates]
    means = [float(np.mean([e.error for e in some])) for some in by_number(outcomes).values() if some[0].truth]
    bands = [band.coverage for o in outcomes for band in o.bands]
    return (
        f"{name:40} {f'{sum(e.covered for e in estimates)}/{len(estimates)}':>9} "
        f"{100.0 * max(means, key=abs, default=nan):+6.1f}% {max(ratios.values(), default=nan):6.2f} "
        f"{100.0 * float(np.mean(bands)) if bands else nan:5.0f}% "
        f"{max(band_widths(outcomes).values(), default=nan):6.2f} "
        f"{sum(bool(o.false_effects(expected.effects)) for o in outcomes):5} {sum(bool(o.alarms) for o in outcomes):6} "
        f"{sum(bool(o.unusable) for o in outcomes):8} {sum(bool(o.error) for o in outcomes):7} "
        f"{float(np.mean([o.seconds for o in outcomes])):6.1f}"
    )


if __name__ == "__main__":
    main()
