"""The vehicle of the Python interface: loaded by name, changed, simulated, built.

What needs NumPy is imported when it is called, so that `rov_fmu.load` is quick.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from rov_fmu.equation.catalogue import Axis
from rov_fmu.io.messages import InputError, only, shown
from rov_fmu.io.numbers import LENGTHS, MOTIONS
from rov_fmu.vehicle.shipped import find_vehicle
from rov_fmu.vehicle.steady import Steady, steady_with
from rov_fmu.vehicle.vehicle import Vehicle, check_coefficients, load_vehicle, warn_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rov_fmu.autopilot.pilot import Pilot
    from rov_fmu.build import Built
    from rov_fmu.interface.arguments import Inputs
    from rov_fmu.interface.result import Result
    from rov_fmu.interface.stepper import VehicleStepper

__all__ = ["Vehicle", "VehicleModel", "load"]

_NONE: Mapping[str, float] = MappingProxyType({})


def load(vehicle: str | Path | Vehicle) -> "VehicleModel":
    """Load a vehicle that ships, by its name, or a vehicle file, by its path.

    - `vehicle`: a name, a path, or a vehicle from elsewhere, such as that of an identification, which is returned
      with the functions of the result.

        rov_fmu.load("bluerov2").response("surge", 0.3)  # V_ss, m/s, and Tau, s, at 30 %

    Raises FileError, a ValueError, with one line for each mistake. Warns (VehicleWarning) where the file says itself
    that the vehicle may not be trusted everywhere.
    """
    if not isinstance(vehicle, str | Path | Vehicle):
        raise InputError(f"vehicle = {shown(vehicle)}: must be the name of a vehicle that ships, or the path of a file")
    if isinstance(vehicle, Vehicle):
        warn_of(vehicle, vehicle.identifier)
    loaded = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(find_vehicle(vehicle))
    return VehicleModel(**{field.name: getattr(loaded, field.name) for field in fields(loaded)})


class VehicleModel(Vehicle):
    """A vehicle that can be simulated, changed and built. `rov_fmu.load` returns one.

    To the vehicle itself, `Vehicle`, it adds no data, only functions that need the layers above. Both are equal.

    All values are in SI units, angles in rad, and commands are fractions of the full command from -1 to 1
    (pulse widths in µs if the vehicle file says so). The variables are
    those of the FMU.
    """

    def simulate(
        self,
        time: "ArrayLike",
        inputs: "Inputs" = _NONE,
        *,
        start: Mapping[str, Any] = _NONE,
        record: str | Sequence[str] | None = None,
    ) -> "Result":
        """Simulate the vehicle with the C code of the FMU; the results are equal to the last bit.

        - `time`: the output times, s, which rise; or the duration, s, which gives a result every 0.01 s from 0 on. Each
          step from one time to the next is exact, whatever its length.
        - `inputs`: the values of inputs by name. The others have their usual values: no command, no load, no current,
          and the usual voltage. The name of an axis, such as `surge`, stands for all commands that drive it: 0.3 is
          30 % of the full command in its positive direction. A number holds at all times. An array has a value for each
          time, which is held up to the next time. A function of an array of times is evaluated in the middle of each
          step and held over the step. Beyond ±1 a command saturates, with a warning. `inputs` may also be a data
          frame. With a column `time` among the inputs, the other arrays have a value for each of its times instead,
          which is held up to the next, also between output times; before the first, the inputs have their usual values.
        - `start`: the values of states at the first time by name; all others are 0. A vehicle with roll or pitch begins
          at the Euler angles phi, theta and psi, rad, which the FMU calls phi_0, theta_0 and psi_0; either name will
          do. Instead of them, `start` may contain the quaternion, and psi, which selects the number of full turns of
          the heading. With a dead time, it may contain the delayed commands, which act at the first time; by default,
          no command acts yet.
        - `record`: the names of the variables to return: inputs, states, derivatives such as `der(u)`, thrust. The
          default is the outputs of the FMU: states and thrust.

        Five seconds at 30 % ahead, and then none, at a depth of 2 m:

            rov = rov_fmu.load("videoray")
            run = rov.simulate(10.0, {"surge": lambda t: np.where(t < 5.0, 0.3, 0.0)}, start={"z": 2.0})
            run["u"][-1]  # m/s

        The first simulation of a kind of vehicle compiles the engine, which takes seconds, and keeps it in the user's
        cache folder.

        Raises InputError if an argument cannot be used, or if the motion cannot be computed because it overflows or
        needs too many steps; BuildError where the engine cannot be compiled.
        """
        from rov_fmu.interface.result import simulated_result

        return simulated_result(self, time, inputs, start, _NONE, record, workers=1, many=False)

    def simulate_many(
        self,
        time: "ArrayLike",
        inputs: "Inputs" = _NONE,
        *,
        start: Mapping[str, Any] = _NONE,
        coefficients: Mapping[str, Any] = _NONE,
        record: str | Sequence[str] | None = None,
        workers: int | None = None,
        lanes: bool = False,
    ) -> "Result":
        """Simulate many variations of the vehicle at once, on all cores.

        - `time`, `inputs`, `start`, `record`: those of `simulate`. An array among the inputs has the shape (times,),
          which holds for all vehicles, (vehicles, 1), or (vehicles, times). A value of `start` is a number, or an array
          of one number for each vehicle.
        - `coefficients`: other values of coefficients by name, in SI units: a number, or one for each vehicle.
        - `workers`: the number of threads, on which the results do not depend. The default is all usable cores.
        - `lanes`: True to step two to eight vehicles at once in the vectors of the processor.

        The speed of a thousand vehicles whose mass is known to 2 %, after 10 s at 30 % ahead:

            masses = np.random.default_rng(1).normal(6.57, 0.13, 1000)  # kg
            rov.simulate_many([0.0, 10.0], {"surge": 0.3}, coefficients={"m_rov": masses})["u"][:, -1]

        By default the results have the bits of the FMU. With `lanes`, steps take a third to three quarters of the time,
        but steps during which commands wait for a dead time gain nothing. The results then differ by rounding errors:
        by less than 1e-12 of the scale of each variable. The first such simulation of a kind of vehicle compiles an
        engine of its own.

        The arrays of the result have the shape (vehicles, times). Where the motion of a vehicle cannot be computed, its
        values are NaN from there on, and `result.failed` has its number.

        Raises InputError about an argument that cannot be used; BuildError where the engine cannot be compiled.
        """
        from rov_fmu.interface.result import simulated_result

        return simulated_result(
            self, time, inputs, start, coefficients, record, workers=workers, many=True, lanes=lanes
        )

    @property
    def force_names(self) -> tuple[str, ...]:
        """The names of the components of `forces`, in their order."""
        from rov_fmu.bridges.arrays import force_names

        return force_names(self.layout)

    def rates(self, x: Any, forces: Any, p: Mapping[str, Any] = _NONE) -> Any:
        """Return the time derivatives of the states: the equation of motion itself, for any library.

        - `x`: the states in the order of `layout.state`: a NumPy array, a CasADi vector (SX, MX, DM) or a JAX array in
          double precision. One of NumPy or JAX may have more dimensions after the first one, for many vehicles.
        - `forces`: what `forces` returns, in the order of `force_names`.
        - `p`: coefficients by name, as numbers, symbols or arrays; the others are those of the vehicle.

        The result has the shape of `x`. All values are in SI units, angles in rad. Where a velocity is 0, the drag has
        the coefficients of the positive direction.

            rov = rov_fmu.load("videoray")
            rov.rates(np.zeros(7), rov.forces({"u_l": 0.3, "u_r": 0.3}))[0]  # the acceleration in surge, m/s2

        Raises InputError if a vector has another length, a coefficient is unknown, or JAX computes in single precision.
        """
        from rov_fmu.bridges import arrays

        return arrays.rates(self, x, forces, p)

    def forces(self, inputs: Mapping[str, Any], p: Mapping[str, Any] = _NONE) -> Any:
        """Return the vector of forces that `rates` takes, for commands, loads and current.

        - `inputs`: inputs by name, as numbers, arrays or symbols of the libraries that `rates` accepts: commands from
          -1 to 1, loads in N and N.m, the current in m/s. The others are 0, and the voltage is the usual one.
        - `p`: coefficients by name, as in `rates`.

        The thrust is the steady one: a lag is part of the rates. A dead time is left out, so the commands act at once.

            dict(zip(rov.force_names, rov.forces({"u_t": 0.5}, {"health_t": 0.8}), strict=True))  # N, N.m, m/s

        Raises InputError if an input or a coefficient is unknown.
        """
        from rov_fmu.bridges import arrays

        return arrays.forces(self, inputs, p)

    def step(self, inputs: Mapping[str, float], state: Mapping[str, float], h: float) -> dict[str, float]:
        """Return the states after h > 0 seconds with the inputs held, exact up to rounding.

        - `inputs`: those of `simulate` as numbers, also along axes; the others have their usual values. Commands act at
          once, unless the delayed commands are given, too.
        - `state`: states by name, in SI units; the others are those at rest.
        - `h`: the length of the step, s.

        This is the second implementation, in Python: it needs no compiler and takes milliseconds. For loops there is
        `stepper`.

            rov.step({"surge": 0.3}, {"z": 2.0}, 0.1)["u"]  # m/s

        Raises InputError about an argument that cannot be used.
        """
        return super().step(self._all_inputs(inputs), self._all_states(state), LENGTHS.checked("h", h))

    def stepper(
        self,
        *,
        start: Mapping[str, Any] = _NONE,
        record: str | Sequence[str] | None = None,
        inputs: Mapping[str, float] = _NONE,
    ) -> "VehicleStepper":
        """Return the vehicle at time 0 s, to be stepped in a loop: with the states of `simulate` to the last bit.

        - `start`, `record`: those of `simulate`.
        - `inputs`: those before the first step, such as the current, which the velocity over ground has at the start.

        It goes on from where it was, with everything that its states do not tell, such as commands that wait for the
        dead time. A controller that holds a depth of 1 m:

            stepper = rov.stepper(record=["z", "w"])
            for _ in range(100):
                stepper.step({"heave": 0.5 * (1.0 - stepper.now["z"]) - 0.5 * stepper.now["w"]}, 0.1)

        Raises InputError about an argument that cannot be used; BuildError where the engine cannot be compiled.
        """
        from rov_fmu.fmu.variables import units_of
        from rov_fmu.interface.arguments import checked_record, checked_start, held_inputs
        from rov_fmu.interface.stepper import VehicleStepper

        check_coefficients(self.layout, self.coefficients)
        begin = {name: value.item() for name, value in checked_start(start, self.layout, many=False).items()}
        begin |= held_inputs(self.layout, inputs)
        return VehicleStepper(self, begin, checked_record(record, self.layout, units_of(self.layout)))

    def autopilot(self, step: float = 0.02, delay: float = 0.015, gains: Mapping[str, float] = _NONE) -> "Pilot":
        """Return an autopilot of the vehicle, with gains that are made for it, to be stepped in a loop.

        - `step`: the time between two calls, s.
        - `delay`: the time from the sensors to the thrust, s.
        - `gains`: those that replace the ones that are made, by the names of the parameters of the autopilot's FMU:
          `k_p_w` is `k_p` of the axis of the velocity w.

        It holds every axis along which the thrusters push:

            pilot, stepper = rov.autopilot().hold(depth=1.0, heading=0.5), rov.stepper()
            for _ in range(500):
                stepper.step(pilot.step(stepper.now, 0.02), 0.02)

        Raises InputError about a gain, or if the thrusters cannot hold any axis, and BuildError where the law cannot be
        compiled.
        """
        from rov_fmu.autopilot.gains import autopilot_of
        from rov_fmu.autopilot.pilot import Pilot

        return Pilot(autopilot_of(self, LENGTHS.checked("step", step), delay).with_gains(gains))

    def hold(
        self,
        seconds: float,
        inputs: Mapping[str, float] = _NONE,
        *,
        start: Mapping[str, Any] = _NONE,
        step: float = 0.02,
        gains: Mapping[str, float] = _NONE,
        **aims: float,
    ) -> "Result":
        """Simulate the vehicle while its autopilot holds places, angles or velocities.

        - `seconds`: the duration, s, which is rounded to whole steps.
        - `inputs`: inputs that are no commands, such as a load or a current.
        - `start`: that of `simulate`.
        - `step`: the time between two commands, s.
        - `gains`: those of `autopilot`.
        - `aims`: `depth`, `heading`, `north` and `east`, `roll`, `pitch` (m, rad), or `surge`, `sway`, `heave`, `yaw`
          (m/s, rad/s).

        The result has `aims` with the rise times and the overshoots, and its plot shows them.

            run = rov.hold(20.0, {"V_N": 0.2}, depth=2.0, heading=0.5)
            run["z"][-1], run.aims["depth"].overshoot  # 2.0 m, less than 0.01 m

        Raises InputError about an argument, also about an axis that the thrusters cannot hold.
        """
        import numpy as np

        from rov_fmu.autopilot.figures import aims_of

        seconds, step = (MOTIONS.checked(key, x) for key, x in (("seconds", seconds), ("step", step)))
        pilot = self.autopilot(step, gains=gains).hold(**aims)
        if wrong := [name for name in inputs if name in self.layout.commands or name in self.layout.by_name]:
            raise InputError(f"inputs[{wrong[0]!r}]: the autopilot gives the commands")
        stepper = self.stepper(start=start, inputs=inputs)
        time = step * np.arange(max(1, round(seconds / step)) + 1)
        commands = list[dict[str, float]]()
        for n in range(len(time)):
            commands.append(pilot.step(stepper.now, step))
            if n + 1 < len(time):
                stepper.step({**inputs, **commands[-1]}, float(time[n + 1] - time[n]))
        given = {name: np.array([one[name] for one in commands]) for name in self.layout.commands}
        result = self.simulate(time, {**inputs, **given}, start=start)
        return replace(result, aims=aims_of(pilot, result, step))

    def derivatives(self, inputs: Mapping[str, float], state: Mapping[str, float]) -> dict[str, float]:
        """Return the time derivatives of the states by their names, in SI units.

        The arguments are those of `step`.

            rov.derivatives({"heave": 0.5}, {})["w"]  # m/s2, down
        """
        return super().derivatives(self._all_inputs(inputs), self._all_states(state))

    def response(self, axis: Axis | str, command: float) -> tuple[float, float]:
        """Return the signed V_ss (m/s or rad/s), and Tau (17) from rest in s, of an axis alone.

        - `axis`: the axis or its name.
        - `command`: a fraction from -1 to 1 of all commands that drive it; positive is its positive direction.

            rov_fmu.load("bluerov2").response("surge", 0.3)

        Raises InputError if the vehicle has no such axis, or if the command is not a finite number.
        """
        from rov_fmu.interface.arguments import checked_number

        return super().response(self._axis(axis), checked_number("command", command))

    def find(self, axis: Axis | str, velocity: float, inputs: Mapping[str, float] = _NONE) -> Steady:
        """Return the command, thrust and electric power that hold a steady velocity along an axis alone.

        - `axis`: the axis or its name.
        - `velocity`: the velocity through the water, m/s or rad/s, with its sign.
        - `inputs`: loads, N and N.m, and the voltage, V, where they are not the usual ones.

            rov_fmu.load("bluerov2").find("surge", 1.0).thrust  # N

        Raises InputError if no command gives this velocity, with the largest one in its direction, and about an input
        that is unknown, is a command or has no number.
        """
        from rov_fmu.interface.arguments import checked_number, checked_values

        kind, velocity = self._axis(axis), checked_number("velocity", velocity)
        given = checked_values("inputs", inputs, self.layout.inputs, many=False)
        for name in given:
            if name in self.layout.commands:
                raise InputError(f"inputs[{name!r}]: the commands are what is found")
        if kind in self.unidentified:
            raise InputError(f"{kind.name} was not identified, so no number of its motion is told")
        return steady_with(self, kind, velocity, {name: float(value) for name, value in given.items()})

    def _axis(self, axis: Axis | str) -> Axis:
        """Return an axis of the vehicle. Raises InputError if it has no axis of this name."""
        kinds = {name: kind.axis for name, kind in self.layout.by_name.items()}
        name = axis.name if isinstance(axis, Axis) else axis
        if not isinstance(name, str) or name not in kinds:
            raise InputError(f"axis = {shown(name)}: the vehicle has no such axis{only(str(name), [*kinds])}")
        return kinds[name]

    def _all_inputs(self, inputs: Mapping[str, float]) -> dict[str, float]:
        """Return the values of all inputs. What is kept between steps, such as commands that act, stays as it is."""
        from rov_fmu.interface.arguments import held_inputs

        layout = self.layout
        kept = {name: value for name, value in inputs.items() if name in layout.memory}
        given = {name: value for name, value in inputs.items() if name not in kept}
        return {**held_inputs(layout, given), **kept}

    def _all_states(self, state: Mapping[str, float]) -> dict[str, float]:
        """Return the values of all states, and the heading of a vehicle with an attitude if it is given."""
        from rov_fmu.interface.arguments import check_name

        for name in state:
            check_name("state", name, self.layout.state, self.layout.continued)
        return {**self.layout.at_rest, **state}

    def build(
        self,
        output: str | Path | None = None,
        *,
        platforms: str | Sequence[str] | None = None,
        backend: str = "native",
        fmi: int = 2,
        interface: str | None = None,
        force: bool = False,
    ) -> "Built":
        """Build the FMU of the vehicle.

        The arguments, the result and the errors are those of `rov_fmu.build.build_fmu`.

            rov.with_(health_l=0.5).build("fouled.fmu", fmi=3, platforms="host")
        """
        from rov_fmu.build import build_fmu

        return build_fmu(
            self,
            output,
            platforms=platforms,
            backend=backend,
            fmi=fmi,
            interface=interface,
            force=force,
        )
