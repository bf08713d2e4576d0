"""Verdicts of vehicles drawn anew: right models are good, and no answer that is far off is called good."""

from pathlib import Path

import pytest

from tests.identify.scenarios.drawn import Drawn, Fault
from tests.identify.scenarios.judge import at_least
from tests.identify.scenarios.outcome import outcome
from tests.identify.scenarios.verdicts import RIGHT, WRONG, Line, broken, off, run


@pytest.mark.long
def test_a_right_model_is_good() -> None:
    """The others are run every week."""
    line = Line.of([run("load of 0.6 %", 0)])
    assert line.words == ["good"]
    assert line.coverage > 0.8
    assert line.far == (0, 0)


@pytest.mark.long
def test_nothing_is_answered_beyond_a_limit_of_the_commands(tmp_path: Path) -> None:
    """The vehicle file goes on beyond the limit, and the vehicle does not."""
    found = outcome(Drawn(("heave",), ("heave",), Fault(saturation=0.4), seconds=30.0), 0, tmp_path / "dives")
    assert ("command limit", "") in {effect[:2] for effect in found.effects}
    answered = [e for e in found.estimates if e.interval]
    assert {e.quantity.split()[1] for e in answered} == {"30", "-30"}
    assert max(map(off, answered)) < 1.5


@pytest.mark.weekly
@pytest.mark.parametrize("seed", range(2))
def test_verdicts_keep_what_they_promise(seed: int) -> None:
    kept = {name: [run(name, seed)] for name in (*RIGHT, *WRONG)}
    assert not [words for words in broken(kept) if "only" not in words]
    right = Line.of([o for name in RIGHT for o in kept[name]])
    assert at_least("good", right.words.count("good"), len(right.words), 0.9).p_value > 0.001
    assert right.coverage > 0.8
