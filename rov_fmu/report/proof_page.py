"""The page of `rov-fmu prove --report`: what was claimed of an FMU, and the evidence."""

import os
import platform
import re
from collections.abc import Callable, Mapping
from functools import partial

import fmpy
from markupsafe import Markup

from rov_fmu import __version__
from rov_fmu.fmu.archive import META_DATA
from rov_fmu.fmu.card import not_to_use, read_card
from rov_fmu.prove.claims import Claim, Proof
from rov_fmu.prove.measures import Evidence
from rov_fmu.report.console import shell_words
from rov_fmu.report.plots.proof import plot_cost, plot_expected, plot_step_deviations
from rov_fmu.report.plots.svg import inline_svg, with_even_text
from rov_fmu.report.templates import number, page

_SIZE = 3.7, 2.0
"""The size of a plot, inches."""
_PLOTS: Mapping[str, Callable[..., None]] = {
    "Expected results": plot_expected,
    "Step size": plot_step_deviations,
    "Cost of a step": plot_cost,
}
"""The plot of a claim, by its name."""
_POWER = re.compile(r"(?<![\w.])\d(?:\.\d+)?e[-+]\d+")


def proof_page(proof: Proof) -> str:
    """Return the page as HTML. It tells on which machine it was made."""

    def plot(claim: Claim, evidence: Evidence) -> Markup | None:
        if not evidence.curve:
            return None
        draw = with_even_text(partial(_PLOTS[claim.name], **evidence.curve))
        return inline_svg(f"{claim.name}: {evidence.sentence}", draw, _SIZE, salt=claim.name)

    return page(
        "proof.html.j2",
        proof=proof,
        card=(card := read_card(proof.card)),
        not_to_use=not_to_use(card),
        meta_data=META_DATA,
        machine=f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors, "
        f"Python {platform.python_version()}, FMPy {fmpy.__version__}, rov-fmu {__version__}",
        command=shell_words("rov-fmu", "prove", proof.fmu.name, "--report", "report.html"),
        plot=plot,
        powers=_powers,
    )


def _powers(text: str) -> str:
    """Return a sentence in which 1.1e-15 is 1.1·10⁻¹⁵."""
    return _POWER.sub(lambda found: number(float(found[0]), 2), text)
