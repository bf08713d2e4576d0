"""What goes wrong in a system that runs is told with the component that it is of."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.bridges.system.connections import Connection, SystemStructure
from rov_fmu.bridges.system.half_step import half_step
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.bridges.system.run import SystemRun, run_system
from rov_fmu.fmus.variable import Value
from rov_fmu.io.messages import FileError
from tests.fmus.conftest import foreign

__all__ = ["foreign"]


def run(fmu: Path, mode: int, limit: float = 60.0) -> SystemRun:
    """Run three components of an FMU, of which the one in the middle has a mode."""
    part = SystemFmu.open(fmu)
    values: dict[str, dict[str, Value]] = {"before": {}, "strange": {"mode": mode, "a": 1.0}, "after": {}}
    connections = [Connection(("strange", "y"), ("before", "u"))] * (mode != 13)
    system = SystemStructure(dict.fromkeys(values, part), values, connections)
    return run_system(system, fmu, [("strange", "y"), ("before", "y")], 0.1, 10, time_limit=limit)


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
@pytest.mark.parametrize(
    ("mode", "message"), [(11, "strange needs more than 3 s"), (12, "strange ended its process"), (10, "")]
)
def test_a_component_that_does_not_end_or_closes_files_is_named(
    mode: int, message: str, foreign: Callable[..., Path]
) -> None:
    if not message:
        run(foreign(), mode)
        return
    with pytest.raises(FileError) as error:
        run(foreign(), mode, 3.0)
    assert str(error.value).startswith(f"{foreign()}: the system cannot be run: {message}")


@pytest.mark.filterwarnings("error")
def test_an_infinite_output_is_told_and_is_no_change(foreign: Callable[..., Path]) -> None:
    found = run(foreign(), 13)
    assert "strange: y is infinite (at 0.1 s)" in found.warnings
    halved = found.rows.copy()
    halved[0, 0] = 0.5
    half = half_step(found.rows, halved, ["m", "m"])
    assert half.typical.tolist() == [0.0, 0.0]
    assert half.largest.tolist() == [0.5, 0.0]
    assert not np.isnan(half.shares).any()
