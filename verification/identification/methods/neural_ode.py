"""A small neural ODE (JAX): the accelerations are those of the regression plus a network with one hidden layer."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.example_libraries import optimizers

from rov_fmu.equation.catalogue import PITCH, ROLL
from rov_fmu.tank.arrays import Array
from verification.identification.data import STEP, Split
from verification.identification.methods.least_squares import BeyondRegression
from verification.identification.methods.motion import Accelerations, linear
from verification.identification.methods.output_error import spreads, windows

_HIDDEN, _STEPS, _BATCH, _RATE = 32, 600, 32, 3e-3
_WINDOW = 40
"""The steps of a window: 2 s."""

Net = dict[str, Any]
State = tuple[jax.Array, jax.Array]


class NeuralODE(BeyondRegression):
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

        start, update, net_of = optimizers.adam(_RATE, b2=0.99)
        gradient, change = jax.jit(jax.grad(loss)), jax.jit(update)
        random, state = np.random.default_rng(1), start(net)
        for k in range(_STEPS):
            some = random.integers(0, len(p), _BATCH)
            state = change(k, gradient(net_of(state), goal[:, some], thrust[some]), state)
        self.rates = self._rates({name: np.asarray(x) for name, x in net_of(state).items()}, np)

    def _rates(self, net: Net, library: Any) -> Accelerations:
        """Return the accelerations, for NumPy or JAX."""
        base = linear(self.axes, self.weights, library)

        def of(p: Array, v: Array, thrust: Array) -> Array:
            x = library.concatenate([v, thrust, library.sin(p) * self.tilts], axis=-1) / self.scale
            found = library.tanh(x @ net["in"] + net["bias"]) @ net["out"] * self.size
            return base(p, v, thrust) + found  # type: ignore[no-any-return]

        return of
