"""The measured roll and pitch of a vehicle without these axes: it is simulated at the measured angles."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.tank.arrays import Array


@dataclass(frozen=True, eq=False)
class Attitude:
    """The roll and pitch that a log contains, n samples, rad."""

    time: Array
    roll: Array
    pitch: Array

    @classmethod
    def of(cls, recording: Recording) -> "Attitude":
        """Return the attitude in a recording that has roll and pitch."""
        roll, pitch = (recording.context[name] for name in ("roll", "pitch"))
        there = np.isfinite(roll) & np.isfinite(pitch)
        return cls(recording.time[there], roll[there], pitch[there])

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return phi and theta at some times."""
        return np.interp(time, self.time, self.roll), np.interp(time, self.time, self.pitch)

    def weight(self, time: Array) -> dict[str, Array]:
        """Return the external forces that make 1 N of net weight in heave act vertically."""
        phi, theta = self.at(time)
        return {
            "X_ext": -np.sin(theta),
            "Y_ext": np.cos(theta) * np.sin(phi),
            "Z_ext": np.cos(theta) * np.cos(phi) - 1.0,
        }

    def turned(self, time: Array, motion: Mapping[str, Array], late: float) -> dict[str, Array]:
        """Return the attitude, the depth and the heading of a motion that is logged `late` s later, and their rates.

        Each is V x n.
        """
        phi, theta = self.at(time + late)
        pitching = np.gradient(theta, time) * np.sin(phi)
        u, v, w, r = (motion.get(name, np.zeros(1)) for name in "uvwr")
        rates = {  # the difference to a level vehicle, whose depth and heading the simulation has already
            "z": np.cos(theta) * (np.sin(phi) * v + np.cos(phi) * w) - np.sin(theta) * u - w,
            "psi": (r + pitching) / (np.cos(phi) * np.cos(theta)) - r,
        }
        angles = {"phi": phi, "theta": theta}
        angles |= {f"der({name})": np.gradient(angle, time) for name, angle in angles.items()}
        shape = next(iter(motion.values())).shape
        found = {name: np.broadcast_to(angle, shape) for name, angle in angles.items()}
        for name, rate in rates.items():
            if name in motion:
                found[name] = motion[name] + cumulative_trapezoid(rate, time, initial=0.0)
                found[f"der({name})"] = motion[f"der({name})"] + rate
        return found
