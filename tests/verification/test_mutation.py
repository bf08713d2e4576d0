"""The mutation test: which tests it runs for a file."""

from verification import mutation
from verification.checkouts import ROOT


def test_every_file_has_tests() -> None:
    files = mutation.files()
    assert {"rov_fmu/equation/python/step.py", "rov_fmu/identify/likelihood/objective.py", "fmu_src/c/step.c"} <= {
        *files
    }
    assert not [test for file in files for test in mutation.tests_of(file) if not (ROOT / test).exists()]
    tests = mutation.tests_of("rov_fmu/equation/alone.py")
    assert tests[0] == "tests/equation/test_alone.py", "those that import it are the first"
    assert mutation.tests_of("rov_fmu/process.py"), "every file of the product has tests"
