"""What identification knows of a vehicle's coefficients, as distributions to draw from."""

from math import log

from scipy.special import ndtri

from rov_fmu.identify.least_squares import is_factor
from rov_fmu.studies.plan import LogNormal, Normal, Varied
from rov_fmu.vehicle.vehicle import Vehicle

_REACH = float(ndtri(0.975))
"""Standard deviations from the middle to an end of a 95 % interval."""


def uncertainty(vehicle: Vehicle) -> dict[str, Varied]:
    """By coefficient: normal with its 95 % interval, and that of a factor's logarithm, as they were fitted.

    An interval that ends at the coefficient's bound was cut off there; the other end tells the width then.
    """
    found = {}
    for name, (low, high) in vehicle.intervals.items():
        value, bound = vehicle.rov[name], vehicle.layout.coefficients[name].minimum
        if low == high:
            continue
        if is_factor(name) and low > 0.0:
            found[name] = Varied(lognormal=LogNormal(median=value, sd=log(high / low) / (2.0 * _REACH)))
        else:
            width = high - value if low <= bound else (high - low) / 2.0
            found[name] = Varied(normal=Normal(mean=value, sd=width / _REACH))
    return found
