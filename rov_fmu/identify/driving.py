"""The relation between the thrust curves and the axes of a vehicle."""

from collections.abc import Iterator

from rov_fmu.model.layout import Axis, Curve, Layout


def curves_of(layout: Layout, axis: Axis) -> list[Curve]:
    """Return the curves of the thrusters that act on an axis."""
    names = {thruster.curve for thruster in layout.drivers(axis)}
    return [curve for curve in layout.curves if curve.name in names]


def connected(layout: Layout) -> Iterator[tuple[list[Curve], list[Axis]]]:
    """Yield groups of curves and of the axes that they drive; no curve or axis is in two groups."""
    remaining = list(layout.curves)
    while remaining:
        curves, axes = [remaining[0]], list[Axis]()
        while True:
            axes = [form.axis for form in layout.axes if any(c in curves for c in curves_of(layout, form.axis))]
            joined = [c for c in layout.curves if any(c in curves_of(layout, axis) for axis in axes)]
            if len(joined) <= len(curves):
                break
            curves = joined
        yield curves, axes
        remaining = [curve for curve in remaining if curve not in curves]
