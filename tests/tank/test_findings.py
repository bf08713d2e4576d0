"""Similar findings share one sentence, and nothing in them is lost."""

from collections.abc import Iterable
from dataclasses import replace

from rov_fmu.identify.findings import SENTENCES
from rov_fmu.tank import findings
from rov_fmu.tank.findings import Finding

A, B, C = "log_heave.csv", "log_heave_2.csv", "log_surge_60.csv"
FORMS = SENTENCES | {
    "outliers": "{axes}: {share:.0%} of the samples of {files} are outliers",
    "late": "{axes}: {of} follows {value:g} s late",
    "free": "{axes}: as many coefficients as points",
}


def sentences(found: Iterable[Finding]) -> tuple[str, ...]:
    return findings.sentences(found, FORMS)


def outliers(axis: str, file: str, share: float) -> Finding:
    return Finding("outliers", axis, file=file, numbers={"share": share})


def test_findings_about_files_share_the_files_and_the_range_of_numbers() -> None:
    found = [outliers("heave", A, 0.12), Finding("not coupled"), outliers("heave", B, 0.09)]
    assert sentences(found) == (
        f"heave: 9% ... 12% of the samples of {A} and {B} are outliers",
        "surge, sway and yaw are not coupled, because coupling needs all three axes",
    )


def test_findings_that_differ_only_in_the_axis_are_one() -> None:
    found = [Finding("free", axis) for axis in ("surge", "heave", "surge")]
    assert sentences(found) == ("surge and heave: as many coefficients as points",)


def test_counts_have_a_singular_and_a_plural() -> None:
    one = Finding("rows sorted", file=A, numbers={"count": 1})
    assert sentences([one]) == (f"{A}: 1 row out of order sorted",)
    assert sentences([one, replace(one, file=B, numbers={"count": 3})]) == (
        f"{A} and {B}: 1 ... 3 rows out of order sorted",
    )
    lost = Finding("unknown velocity", file=A, numbers={"count": 2})
    assert sentences([lost]) == (f"{A}: 2 velocities left out, because the filter marks them as unknown",)
