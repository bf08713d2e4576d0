"""What is held out, by which data, and how uncertain its prediction is."""

import numpy as np
import pytest

from rov_fmu.identify.held_out import unseen_current
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from tests.vehicles import VIDEORAY


def test_the_current_of_an_unseen_log_is_about_that_of_the_others() -> None:
    """Its variance is at least that of 2 cm/s. It may exceed that of the prior."""
    currents = tuple(Parameter("current", file, deviation=0.1, log=n) for n, file in enumerate("abc"))
    table = Table(VIDEORAY.layout, VIDEORAY.coefficients, {}, currents)
    covariance = np.diag([9.0, 0.01**2, 0.02**2])
    usual = 0.02**2 + (0.03**2 + 0.01**2 + 0.04**2 + 0.02**2) / 2.0
    assert unseen_current(table, np.array([5.0, 0.03, -0.04]), covariance, "a") == pytest.approx(usual)
    assert unseen_current(table, np.array([5.0, 0.3, -0.4]), covariance, "a") == pytest.approx(
        0.02**2 + (0.3**2 + 0.01**2 + 0.4**2 + 0.02**2) / 2.0
    )
