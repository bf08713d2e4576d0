"""The figures of the notebooks on the Kalman filter and on the model predictive controller."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

Array = np.ndarray[Any, Any]


def estimates_and_errors(time: Array, quantities: Mapping[str, tuple[Array, Array, Array]]) -> None:
    """Draw a row for each label: its true values, its estimates and their standard deviations; at the right the errors.

    The bands are two standard deviations.
    """
    _, axes = plt.subplots(len(quantities), 2, figsize=(9, 9), sharex=True, layout="constrained")
    for (label, (true, found, deviation)), (left, right) in zip(quantities.items(), axes, strict=True):
        band = 2.0 * deviation
        left.fill_between(time, found - band, found + band, alpha=0.3)
        left.plot(time, found, label="estimate ± 2σ")
        left.plot(time, true, "k--", linewidth=1.0, label="truth")
        left.set_ylabel(label)
        right.fill_between(time, -band, band, alpha=0.3)
        right.plot(time, found - true)
    axes[0, 0].legend()
    axes[0, 1].set_title("error")
    for ax in axes[-1]:
        ax.set_xlabel("time, s")


def consistency(time: Array, means: Mapping[str, Array], limits: Sequence[float]) -> None:
    """Draw the mean normalised error squared over time by its label, and the limits of a consistent filter."""
    _, ax = plt.subplots(figsize=(9, 3.5), layout="constrained")
    ax.axhspan(*limits, alpha=0.2, color="gray", label="95 % of a consistent filter")
    for label, mean in means.items():
        ax.plot(time, mean, label=label)
    ax.set(xlabel="time, s", ylabel="NEES, mean of the flights", ylim=(0.0, None))
    ax.legend()


def station(time: Array, flights: Sequence[tuple[Mapping[str, Array], Mapping[str, Array]]], into: float) -> None:
    """Draw the states (x, y, z, psi) and the commands of flights, the first one in strong lines.

    `into` is the heading into the current, deg.
    """
    _, axes = plt.subplots(4, 1, figsize=(9, 9), sharex=True, layout="constrained")
    for n, (states, commands) in enumerate(flights):
        alpha = 1.0 if n == 0 else 0.3
        rows = (np.hypot(states["x"], states["y"]), states["z"], np.degrees(states["psi"]))
        for ax, row in zip(axes, rows, strict=False):
            ax.plot(time, row, color="C0", alpha=alpha)
        for k, (name, values) in enumerate(commands.items()):
            label = name if n == 0 else None
            axes[3].step(time[:-1], values, where="post", color=f"C{k}", alpha=alpha, label=label)
    axes[2].axhline(into, color="k", linestyle="--", linewidth=1.0, label="into the current")
    for ax, label in zip(axes, ("distance, m", "depth, m", "heading, deg", "commands"), strict=True):
        ax.set_ylabel(label)
    for ax in axes[2:]:
        ax.legend()
    axes[-1].set_xlabel("time, s")
