"""The key `vary_from` of a plan: the estimated coefficients of a vehicle file vary together in a study."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isclose

import numpy as np

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.messages import first_of, listed
from rov_fmu.io.toml_file import key_line
from rov_fmu.study.plan.model import unsettable
from rov_fmu.study.plan.plan import Plan
from rov_fmu.vehicle.uncertainty import NOTHING, Uncertainty
from rov_fmu.vehicle.vehicle import Vehicle

_KEY = "vary_from"
_SHOWN = 5


class Estimates:
    """The coefficients that have an interval in the vehicle file, and that the plan itself does not give."""

    def __init__(self, plan: Plan, vehicle: Vehicle | None, has: Mapping[str, Variable]) -> None:
        self._plan, self._vehicle, self._has = plan, vehicle, has
        self._whole = vehicle.uncertainty if vehicle else NOTHING
        errors = zip(self._whole.names, self._whole.errors.tolist(), strict=True)
        self._part = self._whole.part([name for name, error in errors if error and not self._given(name)])
        self.names = self._part.names
        """The names of the coefficients that vary."""

    @property
    def known(self) -> Uncertainty:
        """The distribution of the coefficients, limited to the bounds of the FMU's variables."""
        own = np.array([(self._has[name].minimum, self._has[name].maximum) for name in self.names]).reshape(-1, 2)
        bounds = [np.maximum(self._part.bounds, own)[:, 0], np.minimum(self._part.bounds, own)[:, 1]]
        return replace(self._part, bounds=np.column_stack(bounds))

    @property
    def mark(self) -> dict[str, object]:
        """The estimates that the results depend on, as JSON values."""
        numbers = zip(self.names, self._part.values.tolist(), self._part.errors.tolist(), strict=True)
        estimates = {name: {"value": value, "error": error} for name, value, error in numbers}
        return {_KEY: {"estimates": estimates, "correlation": self._part.correlation.tolist()}} if estimates else {}

    def check(self) -> Iterator[str]:
        """Yield a line for each estimate that does not fit the plan or the FMU."""
        plan = self._plan
        yield from (key_line(_KEY, reason, plan.vary_from) for reason in self._misfits())
        if plan.sampler == "saltelli" and len(self.names) > len(self._part.groups) + len(plan.vary) == 1:
            reason = "Sobol indices need independent variables, but all varied variables are correlated"
            yield key_line("sampler", reason, plan.sampler)

    def _misfits(self) -> Iterator[str]:
        if self._vehicle and not self._vehicle.intervals:
            yield "no coefficient of this vehicle has an interval"
        elif self._vehicle and not self.names and not self._plan.vary:
            yield "nothing varies, because [set] gives every coefficient that has an interval"
        if self.names and self._plan.sampler == "grid":
            yield "a grid needs values or a range, but estimated coefficients have distributions"
        for name, value in zip(self.names, self._part.values.tolist(), strict=True):
            if reason := unsettable(name, self._has):
                yield reason
            elif reason := self._has[name].wrong(value):
                yield f"{name} of this vehicle does not fit the FMU: it {reason}"

    def warnings(self) -> Iterator[str]:
        """Yield a sentence for each property of the results that a reader may not expect."""
        if not self._vehicle:
            return
        file, has = self._plan.vary_from, self._has
        if (made := self._vehicle.provenance) and made.verdicts and (axes := self._vehicle.unfit_axes):
            yield f"the estimates of {file} do not show how far these axes may be off: {', '.join(axes)}"
        alone = [name for name in self.names if name not in self._vehicle.estimates]
        if alone and len(self.names) > 1:
            yield (
                f"no row in [estimates] of {file}: {some_of(alone)} vary as if correlated with nothing, which makes "
                "what was found together far too uncertain"
            )
        for name, row in zip(self._whole.names, self._whole.correlation, strict=True):
            others = [
                other for other, value in zip(self._whole.names, row, strict=True) if value and other in self.names
            ]
            if self._given(name) and others:
                yield f"the plan gives {name}: its correlation with {some_of(others)} in {file} is left out"
        differ = [
            f"{name} ({has[name].start:g}, not {value:g})"
            for name, value in self._vehicle.coefficients.items()
            if name in has
            and name not in self.names
            and not self._given(name)
            and not isclose(has[name].start, value, rel_tol=1e-9)
        ]
        if differ:
            yield f"the FMU has other values than {file} of {some_of(differ)}: the estimates were found beside those"
        together = [some_of(group) for group in self._part.groups if len(group) > 1]
        if self._plan.sampler == "saltelli" and together:
            yield f"what is correlated has one Sobol index together: {'; '.join(together)}"

    def _given(self, name: str) -> bool:
        """True when the plan itself gives the variable."""
        return name in self._plan.vary or name in self._plan.set


def some_of(words: Sequence[str]) -> str:
    """Return the first words as a list in a sentence."""
    return listed(first_of(words, _SHOWN))
