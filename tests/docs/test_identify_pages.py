"""The examples of the pages about identification work, and what they say of the method is what the code does."""

import re
from importlib import import_module
from pathlib import Path

import pytest
import tomlkit

from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.identify.findings import acting
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood import objective, records, search
from rov_fmu.identify.likelihood.kinds import EFFECTS, KINDS, SLOW
from rov_fmu.identify.result import KEPT, MOST_UNKNOWN
from rov_fmu.identify.verdict import RULES
from tests.commands import ROOT
from tests.folders import FORCE, RATE, SPEED, TAU, read
from tests.report import results

DOCS = ROOT / "docs"
USE, FORMATS, METHOD = (DOCS / f"identify{end}.md" for end in ("", "-formats", "-method"))
QUESTIONS = tomlkit.parse(Path(__file__).with_name("ten_questions.toml").read_text("utf-8")).unwrap()["question"]


def text(page: Path) -> str:
    """A page, with its lines joined."""
    return " ".join(page.read_text("utf-8").split())


@pytest.mark.long
def test_the_complete_rov_toml_makes_a_vehicle(tmp_path: Path) -> None:
    """It is the vehicle file of the page without what the page says that it lacks."""
    whole, *_, part = re.findall(r"```toml\n(.*?)```", (DOCS / "vehicle-file.md").read_text("utf-8"), re.DOTALL)
    example = re.sub(r"format = 2\n|\[validity\]\n.*\n.*\n|[ab]_[td] = .*\n", "", whole)
    curve, _ = part.split("\n\n")
    example = example.replace("[curves.rear]\n", f"{curve}\n")
    levels = (0.2, 0.4, 0.6, 0.8)
    of_level = {
        "thrust_rear": (FORCE, [31.0 * c * c + c for c in levels]),
        "steady_surge": (SPEED, [1.1 * c for c in levels]),
        "steady_yaw": (RATE, [1.3 * c for c in levels]),
        "time_constant_surge": (TAU, [0.6 / c for c in levels]),
    }
    tables = {
        f"{name}.csv": "\n".join([header, *(f"{c},{value:.6f}" for c, value in zip(levels, values, strict=True)), ""])
        for name, (header, values) in of_level.items()
    }
    found = identify(read(tmp_path, example, tables))
    assert [result.axis.name for result in found.axes] == ["surge", "yaw"]
    assert found.vehicle["m_rov"] == 6.57
    assert found.vehicle.layout.thrusters_along(found.axes[1].axis)


def test_the_inertia_of_the_example_is_right() -> None:
    words = (
        r"a vehicle of ([\d.]+) kg gets β = ([\d.]+), it moves like ([\d.]+) kg, of which ([\d.]+) kg are added mass"
    )
    (numbers,) = re.findall(words, text(USE))
    mass, beta, total, added = map(float, numbers)
    assert total == pytest.approx(mass / beta, abs=0.06)
    assert added == pytest.approx(mass * (1.0 / beta - 1.0), abs=0.06)


def test_the_formula_is_that_of_the_code() -> None:
    formula = r"^ {4}(J\(theta, phi\) = .*)$"
    (on_page,) = re.findall(formula, METHOD.read_text("utf-8"), re.MULTILINE)
    assert on_page in (objective.__doc__ or "")


@pytest.mark.parametrize("question", QUESTIONS, ids=[str(n + 1) for n in range(len(QUESTIONS))])
def test_page_and_code_answer_the_question(question: dict[str, str | float]) -> None:
    assert len(QUESTIONS) == 10
    assert str(question["page"]) in text(METHOD)
    module, _, name = str(question["code"]).partition(":")
    if name:
        assert getattr(import_module(module), name) == question["value"]
    else:
        assert str(question["text"]) in (ROOT / module).read_text("utf-8")


def test_the_states_of_the_filter_are_those_of_the_code() -> None:
    code = (ROOT / "fmu_src" / "engine" / "filter.c").read_text("utf-8")
    (members,) = re.findall(r"enum \{\n +N_AXES.*?\n +N_X,", code, re.DOTALL)
    named = re.findall(r"\| `([A-Z]+)` \|", METHOD.read_text("utf-8"))
    assert named == re.findall(r"^ +((?!N_)[A-Z]+)(?: =|,)", members, re.MULTILINE)


def test_the_numbers_of_the_method_are_those_of_the_code() -> None:
    page, least = text(METHOD), KINDS["current"].least_unseen
    assert f"faster than {records.FASTEST:g} per second are averaged" in page
    assert f"up to |u| = c = {objective.OUTLYING:g}, and" in page
    assert f"The filter reads the first {search.SETTLING:g} s" in page
    assert f"positions and headings over {records.AHEAD:g} s" in page
    assert f"a change of thrust of at least {100.0 * KINDS['slow gain'].least_unseen:g} %" in page
    assert (
        f"the current of an unseen log, which is about as large as in the others, but not below {least:g} m/s" in page
    )
    assert f"It is a fact below {100.0 * MOST_UNKNOWN:g} % of the thrust" in page
    assert f"2 ln of its Bayes factor exceeds {KEPT:g} (strong evidence" in page
    assert f"told if 2 ln of its odds exceeds {KEPT:g} and is within {KEPT:g} of the best" in page
    assert f"reads {records.THINNED:g} samples per second" in page
    assert len(EFFECTS) == len(
        page.partition("## Effects ")[2].partition(" are effects")[0].replace(" and ", ", ").split(", ")
    )


# ---- Verdicts --------------------------------------------------------------------------------------------------------


def test_every_reason_of_a_verdict_is_told_with_what_to_do() -> None:
    table = (DOCS / "identify-verdicts.md").read_text("utf-8")
    told = [row.split(" …")[0] for row in re.findall(r"^\| ([A-Z].*?) \|", table, re.MULTILINE)]
    found = [results.disturbance(kind, HEAVE, "log.csv", 1.0, "N", 0.1, 9.0) for kind in SLOW]
    of_disturbances = [acting(one).capitalize() for one in found]
    reasons = [*(rule.sentence for rule in RULES if rule.sentence[0] != "{"), *of_disturbances]
    assert len(reasons) > len(told) > 0
    assert not [reason for reason in reasons if not reason.startswith(tuple(told))]
    assert not [row for row in told if not any(reason.startswith(row) for reason in reasons)]
