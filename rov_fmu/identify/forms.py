"""A vehicle whose curve or axis has other coefficients than before: by direction, with a dead band."""

from collections.abc import Collection
from dataclasses import replace

from rov_fmu.model.layout import AXIS, CURVE, Curve, Layout, VehicleAxis


def with_keys(form: Curve, keys: Collection[str]) -> Curve:
    """A curve with these keys, in the order of their declaration."""
    return replace(form, keys=tuple(key for key in CURVE if key in keys))


def widened(layout: Layout, form: Curve | VehicleAxis) -> Layout:
    """With another form of the curve or the axis of the same name."""
    if isinstance(form, Curve):
        return replace(layout, curves=tuple(form if form.name == old.name else old for old in layout.curves))
    form = replace(form, keys=tuple(key for key in AXIS if key in form.keys))
    return replace(layout, axes=tuple(form if form.axis is old.axis else old for old in layout.axes))
