"""Similar findings share one sentence, and nothing in them is lost."""

from dataclasses import replace

from rov_fmu.identify.findings import sentences
from rov_fmu.tank.findings import Finding

A, B, C = "log_heave.csv", "log_heave_2.csv", "log_surge_60.csv"


def outliers(axis: str, file: str, share: float) -> Finding:
    return Finding("outliers", axis, file=file, numbers={"share": share})


def test_findings_about_files_share_the_files_and_the_range_of_numbers() -> None:
    found = [outliers("heave", A, 0.12), Finding("not coupled"), outliers("heave", B, 0.09)]
    assert sentences(found) == (
        f"heave: 9% ... 12% of the samples of {A} and {B} are outliers and count less",
        "surge, sway and yaw are not coupled, because coupling needs all three axes",
    )


def test_every_axis_of_a_sentence_belongs_to_every_file() -> None:
    found = [outliers(axis, file, 0.1) for axis, file in (("heave", A), ("yaw", A), ("heave", B), ("yaw", B))]
    both = f"heave and yaw: 10% of the samples of {A} and {B} are outliers and count less"
    assert sentences(found) == (both,)
    assert sentences([*found, outliers("surge", C, 0.1)]) == (
        both,
        f"surge: 10% of the samples of {C} are outliers and count less",
    )


def test_findings_that_differ_only_in_the_axis_are_one() -> None:
    found = [Finding("drag without freedom", axis) for axis in ("surge", "heave", "surge")]
    (sentence,) = sentences(found)
    assert sentence.startswith("surge and heave: as many coefficients")


def test_findings_that_differ_otherwise_are_several() -> None:
    delay = Finding("delay", "heave", names={"of": "heave"}, numbers={"value": 0.1})
    pairs = [
        (delay, replace(delay, numbers={"value": 0.2})),
        (outliers("heave", A, 0.1), Finding("correlated residuals", "heave", file=A, numbers={"samples": 4.0})),
        (Finding("unused curve", curve="rear", file=A), Finding("unused curve", curve="top", file=A)),
        (delay, replace(delay, file=A)),
    ]
    for pair in pairs:
        assert len(sentences(pair)) == 2
    assert sentences([]) == ()


def test_counts_have_a_singular_and_a_plural() -> None:
    one = Finding("rows sorted", file=A, numbers={"count": 1})
    assert sentences([one]) == (f"{A}: 1 row out of order sorted",)
    assert sentences([one, replace(one, file=B, numbers={"count": 3})]) == (
        f"{A} and {B}: 1 ... 3 rows out of order sorted",
    )
    lost = Finding("unknown velocity", file=A, numbers={"count": 2})
    assert sentences([lost]) == (f"{A}: 2 velocities left out, because the filter marks them as unknown",)


def test_effects_name_their_interval_and_what_they_act_on() -> None:
    load = Finding("load", "heave", names={"unit": "N", "of": "heave"}, numbers={"value": 2.0, "low": 1.0, "high": 3.0})
    assert sentences([load]) == (
        "heave: a constant load of 2.0 N (1.0 to 3.0) acts in heave (net weight or tether). The model contains this "
        "load",
    )
    current = Finding("current", "surge", file=C, names={"unit": "m/s"}, numbers={"value": 0.1})
    assert sentences([current]) == (
        f"surge: in {C}, the water moved at 0.1 m/s along the axis. The fit removes this current",
    )


def test_what_a_recording_adds_is_not_taken_for_the_whole() -> None:
    """A delay of a single recording comes on top of that of its axis."""
    of_axis = Finding("delay", "surge", names={"unit": "s", "of": "surge"}, numbers={"value": 0.2})
    of_file = Finding("delay", "surge", file="a.csv", names={"unit": "s"}, numbers={"value": 0.05})
    whole, more = sentences([of_axis, of_file])
    assert whole.startswith("surge: the motion of surge follows the commands 0.2 s late.")
    assert more.startswith("surge: the motion in a.csv follows the commands 0.05 s later than in the other recordings.")
