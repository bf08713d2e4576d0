"""Ten near-identical warnings are one, and nothing that they say is lost."""

import pytest

from rov_fmu.identify.grouping import grouped

FILES = ["log_heave.csv", "log_heave_2.csv", "log_surge_60.csv", "rov.toml"]


def of(axis: str, file: str, samples: int) -> str:
    return f"{axis}: the residuals of {file} are correlated over {samples} samples, more than 5.0 % of it"


def test_alike_ones_of_files_are_one_with_all_files_and_the_span_of_numbers() -> None:
    warnings = [of("heave", "log_heave.csv", 12), "other", of("heave", "log_heave_2.csv", 9)]
    assert grouped(warnings, FILES) == (
        "heave: the residuals of log_heave.csv and log_heave_2.csv are correlated over 9 ... 12 samples, "
        "more than 5.0 % of it",
        "other",
    )


def test_files_of_several_axes() -> None:
    warnings = [of("heave", name, 12) for name in FILES[:2]] + [of("surge", "log_surge_60.csv", 12)]
    assert grouped(warnings, FILES) == (
        "heave and surge: the residuals of log_heave.csv, log_heave_2.csv and log_surge_60.csv are correlated over "
        "12 samples, more than 5.0 % of it",
    )


def test_axes_that_say_the_same_are_one() -> None:
    assert grouped(["surge: no interval", "heave: no interval", "yaw: none"], FILES) == (
        "surge and heave: no interval",
        "yaw: none",
    )


@pytest.mark.parametrize(
    "warnings",
    [
        ["heave: a_d_w may be 1 to 3", "heave: a_d_w may be 1 to 4"],
        ["heave: log_heave.csv is short", "heave: log_heave_2.csv is long"],
        ["surge: b_d_u is at its bound", "heave: b_d_w is at its bound"],
        ["log_heave.csv and log_heave_2.csv disagree by 3", "log_heave.csv and log_surge_60.csv disagree by 3"],
        ["rear thrust: no interval", "top thrust: no interval"],
        [],
    ],
)
def test_what_differs_stays(warnings: list[str]) -> None:
    assert grouped(warnings, FILES) == tuple(warnings)


def test_the_same_twice_is_said_once_and_no_files_are_no_trouble() -> None:
    assert grouped(["heave: x", "heave: x"], []) == ("heave: x",)
