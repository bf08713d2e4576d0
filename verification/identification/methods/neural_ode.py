"""A small neural ODE (JAX): the accelerations are those of the regression plus a network with one hidden layer."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from rov_fmu.equation.catalogue import PITCH, ROLL, Axis
from rov_fmu.tank.arrays import Array
from verification.identification.data import STEP, Recording, Split
from verification.identification.methods.least_squares import LeastSquares
from verification.identification.methods.motion import Accelerations, linear, predicted
from verification.identification.methods.output_error import spreads, windows
from verification.identification.protocol import Known

_HIDDEN, _STEPS, _BATCH, _RATE = 32, 600, 32, 3e-3
_WINDOW = 40
"""The steps of a window: 2 s."""

Net = dict[str, Any]
State = tuple[jax.Array, jax.Array]


class NeuralODE(LeastSquares):
    """A network of all velocities, thrusts, and the sines of the angles, trained by Adam through the integration."""

    name = "neural ODE"

    def fit(self, split: Split) -> None:
        """Fit the regression, and the network to windows of 2 s."""
        super().fit(split)
        p, v, thrust = windows(split, _WINDOW)
        axes = len(self.axes)
        inputs = np.concatenate([v, thrust, np.ones_like(v)], axis=2)
        self.scale = inputs.std(axis=(0, 1)) + 1e-6 + (np.arange(3 * axes) >= 2 * axes)
        self.size = v.std(axis=(0, 1)) + 1e-6
        self.tilts = np.array([axis in (ROLL, PITCH) for axis in self.axes], float)
        goal = np.stack([p, v])
        spread = spreads(goal)
        keys = jax.random.split(jax.random.PRNGKey(1))
        net: Net = {
            "in": jax.random.normal(keys[0], (3 * axes, _HIDDEN)) / np.sqrt(3 * axes),
            "bias": jnp.zeros(_HIDDEN),
            "out": 0.01 * jax.random.normal(keys[1], (_HIDDEN, axes)),
        }

        def loss(net: Net, goal: jax.Array, thrust: jax.Array) -> jax.Array:
            rates: Any = self._rates(net, jnp)

            def step(state: State, held: jax.Array) -> tuple[State, jax.Array]:
                p, v = state
                middle = v + 0.5 * STEP * rates(p, v, held)
                after = jnp.clip(v + STEP * rates(p + 0.5 * STEP * v, middle, held), -self.limit, self.limit)
                p = p + STEP * middle
                return (p, after), jnp.stack([p, after])

            _, path = jax.lax.scan(step, (goal[0, :, 0], goal[1, :, 0]), jnp.swapaxes(thrust[:, :-1], 0, 1))
            off = (jnp.moveaxis(path, 0, 2) - goal[:, :, 1:]) / spread[:, None, None]
            return jnp.mean(off**2)

        gradient = jax.jit(jax.grad(loss))
        random = np.random.default_rng(1)
        mean, square = ({name: jnp.zeros_like(x) for name, x in net.items()} for _ in range(2))
        for k in range(1, _STEPS + 1):
            some = random.integers(0, len(p), _BATCH)
            g = gradient(net, goal[:, some], thrust[some])
            for name in net:
                mean[name] = 0.9 * mean[name] + 0.1 * g[name]
                square[name] = 0.99 * square[name] + 0.01 * g[name] ** 2
                change = mean[name] / (1 - 0.9**k) / (jnp.sqrt(square[name] / (1 - 0.99**k)) + 1e-8)
                net[name] = net[name] - _RATE * change
        self.net = {name: np.asarray(x) for name, x in net.items()}

    def _rates(self, net: Net, library: Any) -> Accelerations:
        """Return the accelerations, for NumPy or JAX."""
        base = linear(self.axes, self.weights, library)

        def of(p: Array, v: Array, thrust: Array) -> Array:
            x = library.concatenate([v, thrust, library.sin(p) * self.tilts], axis=-1) / self.scale
            found = library.tanh(x @ net["in"] + net["bias"]) @ net["out"] * self.size
            return base(p, v, thrust) + found  # type: ignore[no-any-return]

        return of

    def predict(self, recording: Recording, begin: float, span: float) -> tuple[Array, Array]:
        """Simulate with the network."""
        values = predicted(self._rates(self.net, np), recording, begin, span, self.limit)[0]
        return values, np.zeros(len(values))

    def coefficients(self, axis: Axis) -> Known:  # noqa: ARG002
        """A network has none."""
        return {}
