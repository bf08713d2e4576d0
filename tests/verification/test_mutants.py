"""Single changes to operators and constants, which the tests must notice."""

from collections.abc import Sequence

import pytest

from tests.commands import ROOT
from tests.verification import mutants


def test_every_file_has_tests_that_hold_it() -> None:
    tests = {test for file in mutants.files() for test in mutants.tests_of(file)}
    assert [test for test in tests if not (ROOT / test).exists()] == []


def test_what_is_named_as_equivalent_is_a_mutant_of_today() -> None:
    known = mutants.equivalents()
    made = {(m.file, m.after) for m in (make() for make in mutants.sites(sorted({file for file, _ in known})))}
    assert sorted(known.keys() - made) == []
    assert all(len(reason) > 20 for reason in known.values())


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        (
            "some.py",
            "a = f'{x * per:g}' if n <= 1 else -0.0",
            {
                "a = f'{x / per:g}' if n <= 1 else -0.0",
                "a = f'{x * per:g}' if n < 1 else -0.0",
                "a = f'{x * per:g}' if n <= 2 else -0.0",
                "a = f'{x * per:g}' if n <= 1 else +0.0",
                "a = f'{x * per:g}' if n <= 1 else -1.0",
            },
        ),
        (
            "some.c",
            "a[1u] = x > 0.5 && !b ? -y * 2.0 : 1e3; /* a * b */",
            {
                "a[2u] = x > 0.5 && !b ? -y * 2.0 : 1e3; /* a * b */",
                "a[1u] = x >= 0.5 && !b ? -y * 2.0 : 1e3; /* a * b */",
                "a[1u] = x > 1.0 && !b ? -y * 2.0 : 1e3; /* a * b */",
                "a[1u] = x > 0.5 || !b ? -y * 2.0 : 1e3; /* a * b */",
                "a[1u] = x > 0.5 && b ? -y * 2.0 : 1e3; /* a * b */",
                "a[1u] = x > 0.5 && !b ? +y * 2.0 : 1e3; /* a * b */",
                "a[1u] = x > 0.5 && !b ? -y / 2.0 : 1e3; /* a * b */",
                "a[1u] = x > 0.5 && !b ? -y * 4.0 : 1e3; /* a * b */",
            },
        ),
    ],
)
def test_a_mutant_is_one_change(file: str, before: str, after: set[str]) -> None:
    assert {mutant.text for mutant in (make() for make in mutants.mutants_of(file, f"{before}\n"))} == {
        f"{line}\n" if file.endswith(".c") else line for line in after
    }


@pytest.mark.parametrize(
    ("sample", "places"),
    [
        pytest.param(6, ["rov_fmu/model/riccati.py"], marks=pytest.mark.long),
        pytest.param(16, mutants.PLACES, marks=pytest.mark.weekly),
    ],
    ids=["of a file with quick tests", "of all files"],
)
def test_most_of_a_sample_are_killed(sample: int, places: Sequence[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Every change of the code draws another sample, and a small one, so the bound leaves room."""
    arguments = ["--sample", str(sample), "--seed", "16", "--jobs", "2", "--least", "0.5", *places]
    assert mutants.main(arguments) == 0, capsys.readouterr().out
