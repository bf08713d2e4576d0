"""Run scenarios and print a table: python -m tests.identify.scenarios NAME ... --seeds N.

A name is that of a scenario or a part of it; without any, all scenarios are run. `--verbose` prints every estimate,
every warning and every refusal.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np

from tests.identify.scenarios.catalogue import SCENARIOS, Scenario
from tests.identify.scenarios.judge import FAMILY, biases, coverages, invented, problems
from tests.identify.scenarios.outcome import Outcome, outcome

_HEADER = (
    f"{'scenario':42} {'covered':>8} {'bias of a_d, b_d, beta':>29} {'alarms':>7} {'invented':>8} {'refused':>7} "
    f"{'CPU s':>7}"
)


@click.command(help=__doc__)
@click.argument("names", nargs=-1)
@click.option("--seeds", default=2, show_default=True, help="The number of seeds.")
@click.option("--verbose", is_flag=True)
def main(names: tuple[str, ...], seeds: int, verbose: bool) -> None:
    """Run the scenarios whose names contain one of the words; a whole name runs that scenario alone."""
    chosen = {
        name: scenario
        for name, scenario in SCENARIOS.items()
        if not names or any(word == name or (word not in SCENARIOS and word in name) for word in names)
    }
    if not chosen:
        raise click.UsageError(f"no such scenario, only: {', '.join(SCENARIOS)}")
    click.echo(_HEADER)
    for name, scenario in chosen.items():
        with TemporaryDirectory() as folder:
            outcomes = [outcome(scenario, seed, Path(folder) / str(seed)) for seed in range(seeds)]
        click.echo(row(name, scenario, outcomes))
        for line in problems(outcomes, scenario, FAMILY):
            click.echo(f"    {line[:160]}")
        if verbose:
            click.echo("\n".join(f"        {line}" for line in details(scenario, outcomes)))


def row(name: str, scenario: Scenario, outcomes: list[Outcome]) -> str:
    """Return the row of a scenario. The biases are the largest ones over the axes."""
    found = coverages(outcomes, scenario)
    means = {b.name: b.mean for b in biases(outcomes, scenario)}
    worst = [
        max((m for n, m in means.items() if n.startswith(key)), key=abs, default=float("nan"))
        for key in ("a_d", "b_d", "beta")
    ]
    covered = f"{sum(c.covered for c in found)}/{sum(c.total for c in found)}"
    seconds = float(np.mean([o.seconds for o in outcomes]))
    alarms, refused = sum(bool(o.alarms) for o in outcomes), sum(bool(o.error) for o in outcomes)
    made_up = sum(bool(invented(o, scenario)) for o in outcomes)
    bias = " ".join(f"{100.0 * mean:+7.1f} %" for mean in worst)
    return f"{name:42} {covered:>8} {bias} {alarms:7} {made_up:8} {refused:7} {seconds:7.1f}"


def details(scenario: Scenario, outcomes: list[Outcome]) -> list[str]:
    """Return a line for every estimate, warning and refusal."""
    lines, truth = [], scenario.truth
    for seed, o in enumerate(outcomes):
        lines += [f"seed {seed}: {line}" for line in o.error.splitlines()]
        for name, estimate in o.coefficients.items():
            low, high = estimate.interval or (float("nan"), float("nan"))
            mark = "" if low <= truth[name] <= high else "  not covered"
            lines.append(f"seed {seed}: {name} {estimate.value:.4g} ({low:.4g} to {high:.4g}), {truth[name]:.4g}{mark}")
        lines += [f"seed {seed}: {sentence}" for sentence in o.sentences]
    return lines


if __name__ == "__main__":
    main()
