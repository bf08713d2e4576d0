"""The command `rov-fmu prove`: the experiments of an FMU, and how far their results are off."""

from pathlib import Path

from rov_fmu.io.messages import ProofError
from rov_fmu.prove.proof import prove_fmu
from rov_fmu.report.console import print_proof
from rov_fmu.report.progress import parts


def print_proof_of(fmu: Path, *, interface: str | None, tolerance: float | None, time_limit: float) -> None:
    """Run the experiments of an FMU, and print the results.

    Raises ProofError if a result is not as expected, and what `prove_fmu` raises.
    """
    with parts() as shown:
        findings = prove_fmu(fmu, interface, tolerance, time_limit, shown.begin("running the experiments"))
    print_proof(findings)
    if wrong := sum(not finding.passed for finding in findings):
        raise ProofError(f"{fmu}: {wrong} of {len(findings)} results are not as expected")
