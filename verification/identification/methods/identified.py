"""This project's identification. What belongs to one log alone has its prior in an unseen log."""

import numpy as np
from threadpoolctl import threadpool_limits

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify import assess, held_out
from rov_fmu.identify.given import Tests
from rov_fmu.identify.identified_vehicle import identified_vehicle
from rov_fmu.identify.likelihood.fit import Fit, fit_all
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.parameters import table_of
from rov_fmu.identify.likelihood.posterior import around
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.tank.arrays import Array
from verification.identification.data import Split
from verification.identification.protocol import Known


class Identified:
    """`rov-fmu identify`: the vehicle of the file, and the covariance of its parameters."""

    name, has_bands = "rov-fmu", True
    tests: Tests
    found: Fit

    def fit(self, split: Split) -> None:
        """Fit all parameters to the training recordings."""
        self.tests = split.tests
        with threadpool_limits(limits=1, user_api="blas"):
            self.found = fit_all(split.known, split.training, split.rows)

    def predict(self, log: SampledLog, begin: float, span: float) -> tuple[Array, Array]:
        """Run the filter until each start, and the model from there on."""
        own = self.found.file.posterior
        table = table_of(self.found.known, [log], [])
        z = np.array([p.mean for p in table.parameters])
        covariance = np.diag([p.deviation**2 for p in table.parameters])
        indices = [(n, own.table.index(p.kind, p.of, p.part)) for n, p in enumerate(table.parameters) if p.log is None]
        here, there = np.array([(n, index) for n, index in indices if index is not None]).T
        z[here], covariance[np.ix_(here, here)] = own.z[there], own.covariance[np.ix_(there, there)]
        for n, p in enumerate(table.parameters):
            if p.of_kind.differs_by_log:
                covariance[n, n] = held_out.unseen_variance(own.table, own.z, own.covariance, p)
        objective = Objective(table, [log], [])
        off, deviations = held_out.ahead(objective, 0, held_out.cautious(objective, z), covariance, begin, span)
        return log.record.value - off, deviations**2

    def coefficients(self, axis: Axis) -> Known:
        """Return the answers that `rov-fmu identify` gives, and the drag over the inertia with its posterior."""
        own = self.found.posterior
        vehicle, _ = identified_vehicle(self.tests, self.found)
        known: dict[str, tuple[float, float, float]] = {}
        tested = assess.tested_commands(self.found.objective, self.found.best.z)[axis]
        for answer in assess.answers(self.found.posteriors, axis, vehicle, tested):
            if abs(answer.command) < 1.0:
                low, high = sorted(map(abs, answer.steady[1]))
                known[f"V_ss {100 * answer.command:g} %"] = abs(answer.steady[0]), low, high

        def drag(z: Array) -> Array:
            model, shapes = own.table.model(z)
            return shapes.motions(model, axis, np.array(assess.COMMANDS[:1])).of["A"]

        (value,), ((variance,),), _ = own.numbers(drag)
        low, high = around(float(value), float(variance) ** 0.5, positive=True)
        return known | {"quadratic drag / inertia": (float(value), low, high)}
