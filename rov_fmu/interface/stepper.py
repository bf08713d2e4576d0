"""A vehicle that is stepped in the loop of a program, such as a controller."""

from collections.abc import Mapping, Sequence

from rov_fmu.c.stepper import Stepper
from rov_fmu.interface.arguments import held_inputs
from rov_fmu.io.messages import InputError
from rov_fmu.io.numbers import LENGTHS
from rov_fmu.vehicle.vehicle import Vehicle


class VehicleStepper:
    """A vehicle that is stepped again and again by the C code of the FMU; `VehicleModel.stepper` makes one.

    `copy.deepcopy` makes a second one, which goes its own way from there.
    """

    def __init__(self, vehicle: Vehicle, start: Mapping[str, float], record: Sequence[str]) -> None:
        self._stepper, self._record = Stepper(vehicle, start, record), tuple(record)
        self._saturated: set[str] = set()

    @property
    def time(self) -> float:
        """The time since the start, s."""
        return self._stepper.time

    @property
    def now(self) -> dict[str, float]:
        """The recorded variables now, by name."""
        return dict(zip(self._record, self._stepper.recorded(), strict=True))

    def step(self, inputs: Mapping[str, float], h: float) -> dict[str, float]:
        """Hold inputs for h > 0 seconds, and return the recorded variables at the end, by name.

        - `inputs`: those of `simulate` as numbers, also along axes. The others have their usual values. Each command
          that saturates gives one warning.
        - `h`: the length of the step, s. It need not be short.

        Thrust without lag is that of the inputs that were held, as in the FMU; `simulate` gives that of the inputs that
        begin at the same time.

            rov_fmu.load("videoray").stepper().step({"surge": 0.3}, 0.1)["u"]  # m/s

        Raises InputError about an argument that cannot be used, or if the motion cannot be computed.
        """
        h = LENGTHS.checked("h", h)
        values = [*held_inputs(self._stepper.vehicle.layout, inputs, self._saturated).values()]
        try:
            return dict(zip(self._record, self._stepper.step(values, h), strict=True))
        except OverflowError as error:
            raise InputError(str(error)) from error
