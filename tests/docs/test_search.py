"""What a user types into the site's search stands in a heading, or in the first sentence, of the page that answers it.

The search of Sphinx ranks titles and headings first; words that no page has find nothing.
"""

import re

import pytest

from tests.commands import ROOT

ANSWERED_BY = {
    "do not use": "identify-verdicts",
    "sign convention": "variables",
    "initial depth": "variables",
    "salt water": "variables",
    "limitations": "model",
    "sampling rate": "identify-formats",
    "step size": "drive",
    "install": "install",
    "DVL": "no-velocity-sensor",
    "Simulink": "drive",
    "how to cite": "cite",
}
"""Eleven questions of users, and the page with the answer."""


def prominent(name: str) -> list[str]:
    """The headings of a page, and its first sentence."""
    text = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    text = re.sub(r"\A---.*?^---\n|^```.*?^```\n|^!\[[^\n]*\n", "", text, flags=re.MULTILINE | re.DOTALL)
    heading = r"^#+ (.*)$"
    first, *_ = re.split(r"[.:](?:\s|$)", re.sub(heading, "", text, flags=re.MULTILINE).strip().partition(": ")[2])
    return [*re.findall(heading, text, re.MULTILINE), " ".join(first.split())]


@pytest.mark.parametrize("question", ANSWERED_BY)
def test_a_question_is_found_at_its_answer(question: str) -> None:
    words = re.compile(rf"\b{question}\b", re.IGNORECASE)
    assert [line for line in prominent(ANSWERED_BY[question]) if words.search(line)]
