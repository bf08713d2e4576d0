"""The command `rov-fmu prove`: what it prints, and with --report the claims, of which one is about vehicles."""

import re
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.fmus.instance import Array
from rov_fmu.io.file_kinds import PAGE
from rov_fmu.io.messages import ProofError, listed
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.prove.check import check_evidence
from rov_fmu.prove.claims import CLAIMS, Claim, prove_claims
from rov_fmu.prove.measures import Evidence, does_not_apply, holds_if, in_short
from rov_fmu.prove.proof import prove_fmu
from rov_fmu.prove.runs import PlannedRun
from rov_fmu.prove.signature import signature_path
from rov_fmu.prove.subject import Subject
from rov_fmu.report.console import print_claims, print_end, print_evidence, print_proof
from rov_fmu.report.progress import parts
from rov_fmu.report.proof_page import proof_page

_GLIDE, _GLIDE_STEPS = 10.0, 100
"""The length of a motion without thrust (s), and its number of steps."""
_DRAG, _LOAD = re.compile(r"[a-z]_d_\w+"), re.compile(r"F_0_\w+|[WB]|[XYZKMN]_[uvwpqr]{2}")
"""The parameters of drag, and those of constant loads, weight, buoyancy and lift."""
_LOSS = 1e-12
"""The increase of an energy, relative to the energy, that is a rounding error."""


def print_proof_of(
    fmu: Path,
    *,
    interface: str | None,
    tolerance: float | None,
    time_limit: float,
    key: Path | None,
    report: Path | None,
    force: bool,
) -> None:
    """Run the experiments of an FMU, or with a page to write (`report`) check all claims, and print the results.

    `key` is the public key that must have signed the FMU. Raises ProofError if a result is not as expected, and what
    `prove_fmu` and `prove_claims` raise.
    """
    how = interface, tolerance, time_limit
    if report:
        check_targets([(report, PAGE)], [fmu, signature_path(fmu), *filter(None, [key])], force=force)
        with parts() as shown:
            proof = prove_claims(fmu, *how, key, CLAIMS_OF_VEHICLES, shown.begin("checking the claims"))
            written = write_whole(Output(report, sealed(proof_page(proof), "prove").encode()), force=force)
        print_claims(proof)
        print_evidence(proof.origin)
        print_end(written, "open it in a browser")
        if failed := proof.with_result("fails"):
            lines = (f"{fmu}: {claim.name.lower()} fails: {one.sentence.rstrip('.')}" for claim, one in failed)
            raise ProofError(*lines)
        return
    evidence = check_evidence(fmu, key)
    with parts() as shown:
        findings = prove_fmu(fmu, *how, shown.begin("running the experiments"))
    print_proof(findings)
    print_evidence(evidence)
    if wrong := sum(not finding.passed for finding in findings):
        raise ProofError(f"{fmu}: {wrong} of {len(findings)} results are not as expected")


def conservation(subject: Subject) -> Evidence:
    """Let a vehicle glide without thrust and drag, and then with drag."""
    if subject.obstacle:
        return does_not_apply(subject.obstacle)
    has = subject.variables
    axes = [axis for axis in AXES.values() if {axis.velocity, axis.external, f"der({axis.velocity})"} <= has.keys()]
    if not axes or not subject.is_ours:
        return does_not_apply("it is known only of vehicles of rov-fmu which parameters switch drag and loads off")
    loads, drag = (dict.fromkeys(filter(kind.fullmatch, has), "0") for kind in (_LOAD, _DRAG))
    if fixed := [name for name in loads | drag if has[name].causality != "parameter"]:
        return does_not_apply(f"{listed(fixed)} cannot be set to 0")
    free, braked = _energies(subject, axes, loads | drag, loads)
    drift = float(np.abs(free / free[0] - 1.0).max())
    gain = float(np.max(np.diff(braked) / braked[0], initial=-inf))
    allowed = subject.allowed
    words = f"Without thrust, drag and constant loads, the kinetic energy stays the same for {_GLIDE:g} s within "
    words += f"{in_short(drift)}; {allowed:.0e} is allowed. With its own drag it falls from {braked[0]:.3g} J to "
    rise = " and never rises" if gain <= _LOSS else f", but rises by {in_short(gain)} in a step"
    words += f"{braked[-1]:.2g} J{rise}."
    return Evidence(holds_if(drift <= allowed and gain <= _LOSS), words, in_short(drift))


def _energies(
    subject: Subject, axes: Sequence[Axis], free: Mapping[str, str], braked: Mapping[str, str]
) -> list[Array]:
    """Return the kinetic energy v' M v / 2 during a glide with parameters that switch drag off, and with others.

    M is measured: its inverse has the accelerations that loads of 1 N or 1 N m give at rest.
    """
    inputs = {v.name: v.start for v in subject.variables.values() if v.causality == "input"}
    velocities = [axis.velocity for axis in axes]
    rates = [f"der({name})" for name in velocities]
    begin = {name: f"{0.5 + 0.1 * n:g}" for n, name in enumerate(velocities)}
    with subject.runs() as child:

        def accelerations(**load: float) -> Any:
            return child.call("run", PlannedRun(0.0, ((1e-3, inputs | load),), free, rates), 1)[0]

        still = accelerations()
        mass = np.linalg.inv(np.column_stack([accelerations(**{axis.external: 1.0}) - still for axis in axes]))
        glides = [
            child.call("run", PlannedRun(0.0, ((_GLIDE, inputs),), {**parameters, **begin}, velocities), _GLIDE_STEPS)
            for parameters in (free, braked)
        ]
    return [0.5 * np.einsum("ti,ij,tj->t", v, mass, v) for v in glides]


_CONSERVATION = Claim(
    "Conservation",
    "Without thrust, the energy never rises; without drag, none is lost.",
    conservation,
    "the parameters a_d, b_d, F_0, W and B in modelDescription.xml, set to 0",
)
CLAIMS_OF_VEHICLES = (*CLAIMS[:3], _CONSERVATION, *CLAIMS[3:])
"""The claims about an FMU that may be one of a vehicle."""
