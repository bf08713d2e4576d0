"""What is known before any test is fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve


@dataclass(frozen=True)
class Prior:
    """What is known before any test is fitted, from which the priors are made."""

    layout: Layout
    coefficients: Mapping[str, float]
    """All coefficients of the layout. Those of axes that nothing gives are guesses from the data."""
    fitted: Sequence[Axis]
    """The axes whose motion is tested."""
    curves: Sequence[Curve]
    """The curves that drive these axes."""
    measured_curves: Mapping[str, bool]
    """The curves whose forces were measured, and whether astern, too. Their scale and shape are those of the rows."""
    with_lag: bool
    """True if the base or the file gives a lag."""
    guessed: Sequence[str]
    """The names of the axes whose drag is guessed from the data."""
    full: Mapping[str, float]
    deviations: Mapping[str, float]
    """The table [priors] of rov.toml."""
    exact: frozenset[str] = frozenset()
    """The names of the coefficients that no fit changes."""
    thrust_errors: Mapping[str, float] = field(default_factory=dict)
    """The relative standard error of a curve's forces, by its name, where rov.toml gives it."""
    unseen: Sequence[Axis] = ()
    """The axes along which the dives move, and that no test shows. Their drag and inertia are about those given, or
    guessed from the thrust."""
    has_times: bool = False
    """True if there are tables of time constants, which contain the lag."""
    freed: frozenset[tuple[str, str]] = frozenset()
    """The rows of hypotheses about the structure that a fit may change, by their kind and what has them. The others
    stay where they change nothing."""
    turned: Sequence[tuple[str, ...]] = ()
    """The thrusters that rov.toml says to be reversed, and those that it says to be mounted the other way."""
    own_curves: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """The curves of single thrusters: the curve that each was before, and the thruster. The thrust astern and the dead
    bands differ, and all else is shared."""
