"""Change the coefficients of a curve or an axis, for example to add a dead band."""

from collections.abc import Collection
from dataclasses import replace

from rov_fmu.model.layout import AXIS, CURVE, Curve, Layout, VehicleAxis


def with_keys(form: Curve, keys: Collection[str]) -> Curve:
    """Return the curve with these keys, in the order of their declaration."""
    return replace(form, keys=tuple(key for key in CURVE if key in keys))


def widened(layout: Layout, form: Curve | VehicleAxis) -> Layout:
    """Replace the curve or axis of the same name."""
    if isinstance(form, Curve):
        return replace(layout, curves=tuple(form if form.name == old.name else old for old in layout.curves))
    form = replace(form, keys=tuple(key for key in AXIS if key in form.keys))
    return replace(layout, axes=tuple(form if form.axis is old.axis else old for old in layout.axes))
