"""How often a property is tried: a few times by default, more often in the long tests, and most often every week."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def often(name: str, usual: Any, long: Any, weekly: Any = None) -> pytest.MarkDecorator:
    """Give a test an argument with a number for each kind of run."""
    values = [usual, pytest.param(long, marks=pytest.mark.long)]
    return pytest.mark.parametrize(
        name, values if weekly is None else [*values, pytest.param(weekly, marks=pytest.mark.weekly)]
    )


def spread(cases: Iterable[Any], default: Collection[Any] = (), long: Collection[Any] = ()) -> list[Any]:
    """Return the cases of a property: some for the default tests, some for the long ones, others for once a week."""

    def kind(case: Any) -> Any:
        return () if case in default else pytest.mark.long if case in long else pytest.mark.weekly

    return [pytest.param(case, marks=kind(case)) for case in cases]
