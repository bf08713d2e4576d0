"""A delay from the commands to the motion, or between two clocks."""

from collections.abc import Iterator

from rov_fmu.identify.effects.effect import Effect, Setting, of_axis_and_files
from rov_fmu.model.layout import Axis


class Delay(Effect):
    """The delay of an axis, or what a single recording adds to it."""

    kind = "delay"
    words = "delay from the commands to the motion"
    sentence = (
        "the motion of {of} follows the commands {value} s late{interval}. The vehicle file has no "
        "delay. `T_d` in [commands] of the vehicle file adds one to the FMU, which is the same for all axes"
    )
    sentence_of_file = (
        "the motion in {of} follows the commands {value} s later{interval} than in the other recordings. The model "
        "does not contain this difference"
    )
    limits = -5.0, 5.0
    order = 8
    is_delay = True

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the delay of each axis, and of each recording but the first."""
        for axis in setting.axes:
            yield from of_axis_and_files(cls, setting, axis)

    def unit(self, axis: Axis) -> str:  # noqa: ARG002
        """Return the unit of time."""
        return "s"

    def prior(self, setting: Setting) -> float:  # noqa: ARG002
        """Return the usual delay; single recordings differ less."""
        return 0.2 * self.deviation if self.is_of_file else self.deviation
