"""Gymnasium environments of a vehicle: one, or many with coefficients drawn from their uncertainty.

The task is to hold station: the vehicle starts at rest in a random place near the origin and should return there and
stay, heading north. The action holds the commands from -1 to 1 (as fractions), the observation all states. The depth
counts from the place to hold, which is deep under water, so that no surface acts. What a policy has to beat is the
autopilot of the vehicle (`baseline`).

Gymnasium knows the environment as ID, once this module is imported:

    gymnasium.register_envs(rov_fmu.bridges.gym)
    env = gymnasium.make("rov_fmu/HoldStation-v0", vehicle="bluerov2", draws=False)
"""

import warnings
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.autopilot.pilot import PLACES, Pilot
from rov_fmu.c.stepper import LaneStepper
from rov_fmu.io.messages import InputError, shown
from rov_fmu.vehicle.shipped import find_vehicle
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface

Array = NDArray[np.float64]
STEP = 0.1
"""The length of a step by default, s."""
STEPS = 300
"""The steps of an episode by default."""
START = 2.0
"""The vehicle starts within this distance of the origin along each axis, m, and within this heading, rad."""
Draws = Literal[True, False, "force"]
ID = "rov_fmu/HoldStation-v0"
"""The name for `gymnasium.make` and `gymnasium.make_vec`."""
BOUND = 1000.0
"""The largest size of a state in an episode, in SI units."""


class RovVectorEnv(VectorEnv[Array, Array, Any]):
    """Many vehicles at once. Each has coefficients of its own, drawn from their uncertainty (`Vehicle.uncertainty`).

    The reward is minus the sum of the squares of the position (m) and the heading (rad, of a vehicle without roll and
    pitch), and a tenth of that of the commands. An episode is truncated after `steps` steps of `step` seconds, and
    begins anew in the step after that. It is terminated when a state exceeds BOUND or the motion cannot be computed.
    With `draws=False`, all vehicles have the coefficients of the file; where it has no uncertainty, a warning says that
    none are drawn. An axis whose verdict is neither good nor usable is an InputError, unless `draws="force"`. The
    processor's vectors step several vehicles at once, so that the states differ from those of the FMU by rounding
    errors.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self, vehicle: Vehicle, count: int = 1, *, step: float = STEP, steps: int = STEPS, draws: Draws = True
    ) -> None:
        if not isinstance(vehicle, Vehicle):
            raise InputError(f"vehicle = {shown(vehicle)}: must be a vehicle, such as rov_fmu.load returns")
        for name, value in {"count": count, "step": step, "steps": steps}.items():
            if not value > 0:
                raise InputError(f"{name} = {shown(value)}: must be above 0")
        vehicle = without_surface(vehicle)
        layout = vehicle.layout
        self.vehicle, self.num_envs, self.length, self.steps = vehicle, count, step, steps
        self.draws: Draws = draws if len(vehicle.uncertainty.names) else False
        if draws and not self.draws:
            reason = "its file has no uncertainty, so no coefficients are drawn: draws=False says that this is meant"
            warnings.warn(f"{vehicle.identifier}: {reason}", stacklevel=2)
        self.states, self.commands = tuple(layout.state), tuple(layout.commands)
        self.targets = [n for n, name in enumerate(self.states) if name in ("x", "y", "z", "psi")]
        self.single_observation_space = Box(-BOUND, BOUND, (len(self.states),), np.float64)
        self.single_action_space = Box(-1.0, 1.0, (len(self.commands),), np.float64)
        self.observation_space = batch_space(self.single_observation_space, count)
        self.action_space = batch_space(self.single_action_space, count)
        self.coefficients: dict[str, Array] = {}
        self._stepper = LaneStepper(vehicle, count)
        self.elapsed = np.zeros(count, int)
        self.over = np.zeros(count, bool)
        self._pilots: dict[int, Pilot] = {}

    @property
    def state(self) -> Array:
        """The states (vehicles x states). They may be set."""
        return self._stepper.states

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Draw all coefficients and starts anew. Return the states (vehicles x states), in SI units.

        - `seed`: the seed of the draws; of a list, the first one counts.
        - `options`: none are known.

            states, _ = RovVectorEnv(rov_fmu.load("videoray_refit"), 16).reset(seed=1)
        """
        super().reset(seed=seed[0] if isinstance(seed, list) else seed, options=options)
        if self.draws:
            drawn = self.vehicle.draws(self.num_envs, self.np_random, forced=self.draws == "force")
            self.coefficients = {name: column[:, np.newaxis] for name, column in drawn.items()}
        self._begin(np.ones(self.num_envs, bool))
        return self.state.copy(), {}

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Hold the commands (vehicles x commands) for one step. Vehicles whose episode is over begin a new one.

        - `actions`: the commands from -1 to 1, also of a vehicle whose commands are pulse widths.

            many = RovVectorEnv(rov_fmu.load("videoray").with_(health_l=0.5), 16, draws=False)
            many.reset(seed=1)
            states, reward, terminated, truncated, _ = many.step(np.zeros((16, 3)))

        Raises InputError if the actions have another shape or are not finite.
        """
        fractions = np.clip(np.asarray(actions, float), -1.0, 1.0)
        shape = self.num_envs, len(self.commands)
        if fractions.shape != shape:
            raise InputError(f"actions: must have the shape {shape}, and have the shape {fractions.shape}")
        if len(wrong := np.argwhere(~np.isfinite(fractions))):
            vehicle, n = wrong[0].tolist()
            raise InputError(f"actions: {self.commands[n]} of vehicle {vehicle} must be a finite number")
        layout, begun = self.vehicle.layout, self.over.copy()
        command_of = np.vectorize(layout.command_of, otypes=[float]) if layout.pulse else np.asarray
        for n in range(len(self.commands)):
            self._stepper.inputs[:, n] = command_of(fractions[:, n])
        before = self.state.copy()
        failed = (self._stepper.step(self.length) | ~(np.abs(self.state) <= BOUND).all(axis=1)) & ~begun
        self.state[failed] = before[failed]
        self.elapsed[~(failed | begun)] += 1
        reward = -np.sum(self.state[:, self.targets] ** 2, axis=1) - 0.1 * np.sum(fractions**2, axis=1)
        truncated = (self.elapsed >= self.steps) & ~begun
        self._begin(begun)
        reward[begun] = 0.0
        self.over = failed | truncated
        return self.state.copy(), reward, failed, truncated, {}

    def baseline(self) -> Array:
        """Return the actions of the vehicles' autopilots now (vehicles x commands), once per step.

        They hold the place to hold and north, as far as the thrusters push along these axes, with gains for the vehicle
        of the file and the step. Those of a vehicle that cannot be held along surge and sway leave its place.

            many = RovVectorEnv(rov_fmu.load("bluerov2"), 16, draws=False)
            many.reset(seed=1)
            states, reward, *_ = many.step(many.baseline())

        Raises InputError if the thrusters cannot hold any axis.
        """
        layout = self.vehicle.layout
        actions = np.empty((self.num_envs, len(self.commands)))
        for n in range(self.num_envs):
            if n not in self._pilots:
                made = autopilot_of(self.vehicle, self.length)
                held = {name for name, axis in PLACES.items() if axis in made.axes}
                held -= set() if {"north", "east"} <= held else {"north", "east"}
                self._pilots[n] = Pilot(made).hold(**dict.fromkeys(held, 0.0))
            now = dict(zip(layout.places, self._stepper.variables(n).tolist(), strict=True))
            actions[n] = [*map(layout.fraction_of, self._pilots[n].step(now, self.length).values())]
        return actions

    def _begin(self, which: NDArray[np.bool_]) -> None:
        """Start new episodes, with no command on its way."""
        numbers = np.flatnonzero(which)
        if not len(numbers):
            return
        start = np.tile([self.vehicle.layout.at_rest[name] for name in self.states], (len(numbers), 1))
        start[:, self.targets] = self.np_random.uniform(-START, START, (len(numbers), len(self.targets)))
        own = {name: column[numbers] for name, column in self.coefficients.items()}
        self._stepper.begin(own | dict(zip(self.states, start.T[:, :, np.newaxis], strict=True)), numbers.tolist())
        self.elapsed[which], self.over[which] = 0, False
        self._pilots = {n: pilot for n, pilot in self._pilots.items() if not which[n]}


class RovEnv(gymnasium.Env[Array, Array]):
    """One vehicle: a `RovVectorEnv` of one, with the same arguments, that ends its episodes itself."""

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(self, vehicle: Vehicle, *, step: float = STEP, steps: int = STEPS, draws: Draws = True) -> None:
        self.many = RovVectorEnv(vehicle, step=step, steps=steps, draws=draws)
        self.states, self.commands = self.many.states, self.many.commands
        self.observation_space, self.action_space = self.many.single_observation_space, self.many.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Draw the coefficients and the start anew. Return the states, in SI units.

        - `seed`, `options`: those of `RovVectorEnv.reset`.

            state, _ = RovEnv(rov_fmu.load("videoray"), draws=False).reset(seed=1)
        """
        super().reset(seed=seed)
        state, info = self.many.reset(seed=seed, options=options)
        return state[0], info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold the commands for one step.

        - `action`: the commands from -1 to 1.

            one = RovEnv(rov_fmu.load("videoray"), draws=False)
            one.reset(seed=1)
            state, reward, terminated, truncated, _ = one.step(np.zeros(3))
        """
        if np.shape(action) != self.action_space.shape:
            raise InputError(f"action: must have the shape {self.action_space.shape}, and has {np.shape(action)}")
        state, reward, terminated, truncated, info = self.many.step(np.asarray(action)[np.newaxis])
        return state[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def baseline(self) -> Array:
        """Return the action of the vehicle's autopilot now, once per step (`RovVectorEnv.baseline`).

        one = RovEnv(rov_fmu.load("bluerov2"), draws=False)
        one.reset(seed=1)
        state, reward, *_ = one.step(one.baseline())
        """
        action: Array = self.many.baseline()[0]
        return action


def _named(vehicle: Vehicle | str) -> Vehicle:
    return vehicle if isinstance(vehicle, Vehicle) else load_vehicle(find_vehicle(vehicle))


def one_environment(vehicle: Vehicle | str = "bluerov2", **options: Any) -> RovEnv:
    """Return a RovEnv of a vehicle, or of the name or the file of one. The options are those of RovEnv."""
    return RovEnv(_named(vehicle), **options)


def many_environments(num_envs: int = 1, vehicle: Vehicle | str = "bluerov2", **options: Any) -> RovVectorEnv:
    """Return a RovVectorEnv of a vehicle, or of the name or the file of one. The options are those of RovVectorEnv."""
    return RovVectorEnv(_named(vehicle), num_envs, **options)


gymnasium.register(
    ID,
    entry_point=f"{__name__}:{one_environment.__name__}",
    vector_entry_point=f"{__name__}:{many_environments.__name__}",
)
