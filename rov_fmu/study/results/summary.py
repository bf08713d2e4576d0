"""The summary that the command line prints after a study."""

import numpy as np

from rov_fmu.report.console import console, paragraph, print_table, shell_words, table, text
from rov_fmu.report.progress import per_second
from rov_fmu.study.plan.plan import REASON
from rov_fmu.study.results.results import Results, statistics

_SHOWN = (0.05, 0.5, 0.95)
_FAILURES = 5
"""The number of reasons that are shown, the most frequent first."""


def print_summary(results: Results, now: int, seconds: float) -> None:
    """Print the number of runs, the speed, the quantiles of the figures, and why runs failed or figures are missing.

    `now` is the number of runs that were done now, in so many seconds.
    """
    out, runs = console(), results.runs
    counts = f"{len(runs)} runs, {len(results.failed)} failed, {len(results.incomplete)} incomplete"
    paragraph(out, f"{shell_words(results.folder)}: {counts}")
    if now:
        rate = per_second(now / max(seconds, 1e-3))
        paragraph(out, f"  {now:,} of them now, in {seconds:.1f} s; {rate}")
    if results.figures:
        shown = table("", "figure", [*(f"{q:.0%}" for q in _SHOWN), "mean", "runs"])
        for name in results.figures:
            values = runs[name].to_numpy(float)
            there = values[np.isfinite(values)]
            quantiles, mean, _ = statistics(there, _SHOWN)
            shown.add_row(name, *(text(number, ".5g") for number in (*quantiles, mean)), str(there.size))
        print_table(shown)
    reasons = runs[REASON].value_counts()
    for reason, count in reasons.head(_FAILURES).items():
        paragraph(out, f"  {count} runs: {reason}")
    if len(others := reasons[_FAILURES:]):
        paragraph(out, f"  {others.sum()} runs: other reasons ({len(others)}), which are on the page")
