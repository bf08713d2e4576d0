"""The claims about an FMU that `rov-fmu prove --report` checks: each with its measurement and where to look."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rov_fmu.fmu.archive import CARD, FOLDER
from rov_fmu.fmus.description import TIME_LIMIT
from rov_fmu.fmus.instance import RunError
from rov_fmu.io.child_process import ChildError
from rov_fmu.io.messages import Progress, ProofError, silent
from rov_fmu.io.reading import hash_of, open_file
from rov_fmu.prove import measures
from rov_fmu.prove.check import MetaData, check_evidence
from rov_fmu.prove.measures import Evidence
from rov_fmu.prove.proof import remedy
from rov_fmu.prove.subject import Subject, opened


@dataclass(frozen=True)
class Claim:
    """What an FMU should do, how it is measured, and where the details are."""

    name: str
    sentence: str
    measure: Callable[[Subject], Evidence]
    where: str


CLAIMS = (
    Claim(
        "Expected results",
        "The FMU gives the results that it carries.",
        measures.expected,
        f"{FOLDER} in the FMU; rov-fmu prove without --report prints every experiment",
    ),
    Claim(
        "Step size",
        "The result does not depend on the communication step.",
        measures.step_size,
        "the simulation named in the evidence, run with any steps in any importer",
    ),
    Claim(
        "Repeatability",
        "The same run gives the same bits every time.",
        measures.repeatability,
        "the same simulation, repeated in any importer",
    ),
    Claim(
        "Cost of a step",
        "A step is fast, and takes about as long each time.",
        measures.step_cost,
        "this machine; another one has other times",
    ),
    Claim(
        "Limits",
        "What is impossible is refused, and changes nothing.",
        measures.limits,
        "min and max in modelDescription.xml; the log of the FMU",
    ),
)
"""The claims about any FMU, in the order of the report. A new claim is a function in measures.py and an entry here."""


@dataclass(frozen=True)
class Proof:
    """An FMU with the evidence for every claim."""

    fmu: Path
    digest: str
    """The SHA-256 of the file."""
    description: Any
    """FMPy's description of the FMU."""
    origin: MetaData
    """What its hashes and the signature beside it say."""
    card: str
    """The text of the model card of an FMU of ours; empty if the FMU has none."""
    evidence: Sequence[tuple[Claim, Evidence]]

    def with_result(self, result: measures.Result) -> list[tuple[Claim, Evidence]]:
        """Return the claims that have a result."""
        return [(claim, one) for claim, one in self.evidence if one.result == result]


def prove_claims(
    fmu: Path,
    interface: str | None = None,
    tolerance: float | None = None,
    time_limit: float = TIME_LIMIT,
    key: Path | None = None,
    claims: Sequence[Claim] = CLAIMS,
    on_progress: Progress = silent,
) -> Proof:
    """Check claims about an FMU of any exporter, and return the evidence.

    The arguments are those of `prove` and of `check_evidence`; only the expected results can use Model Exchange. An FMU
    that ends its process or exceeds a limit fails the claim that was checked, and the others are checked all the same.
    Raises what `check_evidence` raises, before the FMU is run, and FileError.
    """
    origin = check_evidence(fmu, key)
    with opened(fmu, interface, tolerance, time_limit) as subject:
        evidence = []
        for n, claim in enumerate(claims):
            on_progress(claim.name.lower(), n / len(claims))
            evidence.append((claim, _checked(claim, subject)))
        with open_file(fmu) as file:
            sha256 = hash_of(file, "sha256").hex()
        card = Path(subject.folder, CARD)
        text = card.read_text(encoding="utf-8", errors="replace") if card.is_file() else ""
        return Proof(fmu, sha256, subject.description, origin, text, evidence)


def _checked(claim: Claim, subject: Subject) -> Evidence:
    """Return the evidence for a claim, which fails if the FMU ends its process or does not run."""
    try:
        return claim.measure(subject)
    except ProofError as error:
        return Evidence("fails", f"{str(error).removeprefix(f'{subject.path}: ')}.")
    except (ChildError, RunError) as error:
        who = "The FMU " if isinstance(error, ChildError) else ""
        return Evidence("fails", f"{who}{error}{remedy(error)}.")
