"""One of several sets of parameters of the filter."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from rov_fmu.identify.likelihood.filter import Parameters, Slow


def one_set(sets: Parameters, n: int) -> Parameters:
    """Return one of several sets."""
    found = {field.name: _of(getattr(sets, field.name), n) for field in fields(sets) if field.name != "inputs"}
    inputs = sets.inputs if sets.inputs is None or sets.inputs.ndim == 2 else sets.inputs[n]
    return replace(sets, **{**found, "inputs": inputs, "count": 1})


def _of(value: Any, n: int) -> Any:
    if isinstance(value, Slow):
        return Slow(_of(value.size, n), _of(value.time_constant, n))
    if isinstance(value, Mapping):
        return {key: _of(each, n) for key, each in value.items()}
    if isinstance(value, tuple):
        return tuple(_of(each, n) for each in value)
    return value[n] if np.ndim(value) else value
