"""How often a property is tried: a few times by default, more often in the long tests, and most often every week."""

from typing import Any

import pytest


def often(name: str, usual: Any, long: Any, weekly: Any = None) -> pytest.MarkDecorator:
    """Give a test an argument with a number for each kind of run."""
    values = [usual, pytest.param(long, marks=pytest.mark.long)]
    return pytest.mark.parametrize(
        name, values if weekly is None else [*values, pytest.param(weekly, marks=pytest.mark.weekly)]
    )
