"""Vehicles of every kind, with numbers of a plausible size: what tests that hold for any vehicle run over."""

from math import sqrt

from rov_fmu.motion.layout import AXES, HEAVE, SURGE, SWAY, YAW, Axis, Curve, Layout, Thruster, VehicleAxis
from rov_fmu.motion.rov import Rov
from rov_fmu.vehicle.paper import PAPER
from rov_fmu.vehicle.vehicle import Vehicle

_C = sqrt(0.5)
_CORNERS = {"1": (1, -1, 1, 1), "2": (1, 1, 1, -1), "3": (-1, -1, -1, 1), "4": (-1, 1, -1, -1)}
_VECTORED = tuple(
    Thruster(name, "t200", (_C * x, _C * y, 0.0), (0.156 * at_x, 0.111 * at_y, 0.0))
    for name, (x, y, at_x, at_y) in _CORNERS.items()
)
_VERTICAL = tuple(
    Thruster(str(n), "t200", (0.0, 0.0, 1.0), (0.12 * x, 0.218 * y, 0.0))
    for n, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1)), start=5)
)
_EVERY_KEY = ("m_a", "a_d", "b_d", "a_d_reverse", "b_d_reverse", "F_0")


def _axes(*axes: Axis, keys: tuple[str, ...] = ("m_a", "a_d", "b_d")) -> tuple[VehicleAxis, ...]:
    return tuple(VehicleAxis(axis, keys) for axis in axes)


LAYOUTS = {
    "the paper's": PAPER,
    "eight thrusters, coupled, with lag, dead band and reverse curve": Layout(
        _axes(*AXES.values()),
        (Curve("t200", ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "T")),),
        _VECTORED + _VERTICAL,
        coupled=True,
    ),
    "four thrusters by three commands, no heave": Layout(
        _axes(SURGE, SWAY, YAW, keys=_EVERY_KEY),
        (Curve("t200", ("a_t", "b_t", "c_0", "c_0_reverse")),),
        _VECTORED,
        mix={
            "ahead": {"1": 1.0, "2": 1.0, "3": -1.0, "4": -1.0},
            "aside": {"1": -1.0, "2": 1.0, "3": -1.0, "4": 1.0},
            "turn": {"1": -0.5, "2": 0.5, "3": 0.5, "4": -0.5},
        },
        coupled=True,
    ),
    "an arm with lag beside a swift thruster": Layout(
        _axes(SURGE, HEAVE, YAW),
        (Curve("rear", ("a_t", "b_t", "T"), together=2), Curve("top")),
        PAPER.thrusters,
    ),
    "sway and yaw": Layout(
        _axes(SWAY, YAW), (Curve("bow"),), (Thruster("b", "bow", (0.0, 1.0, 0.0), (0.5, 0.0, 0.0)),)
    ),
    "surge and sway without yaw": Layout(
        _axes(SURGE, SWAY, keys=_EVERY_KEY),
        (Curve("t200"),),
        (Thruster("a", "t200", (0.6, 0.8, 0.0), (0.0, 0.0, 0.1)),),
    ),
    "heave alone": Layout(
        _axes(HEAVE, keys=_EVERY_KEY),
        (Curve("top", ("a_t", "b_t", "T")),),
        (Thruster("t", "top", (0.0, 0.0, -1.0)),),
    ),
}  # fmt: skip

_SIZES = {"m_rov": 13.5, "I_r": 0.37, "R": 0.22, "gamma": 0.42, "a_t": 29.3, "b_t": 31.5, "c_0": 0.087, "T": 0.15,
          "m_a": 6.4, "a_d": 141.0, "b_d": 13.7, "F_0": 0.7, "alpha": 1.1, "beta": 0.8}  # fmt: skip


def a_rov(layout: Layout) -> Rov:
    """A vehicle with what a layout asks for; in reverse a quarter weaker."""
    values = {}
    for name in layout.coefficients:
        size = next(size for key, size in _SIZES.items() if name == key or name.startswith(f"{key}_"))
        values[name] = size * (0.75 if name.endswith("_reverse") else 0.03 if name.endswith("_r") else 1.0)
    return Rov(layout, values)


def a_vehicle(layout: Layout) -> Vehicle:
    """A vehicle of this layout with nothing but its numbers."""
    rov = a_rov(layout)
    sources = dict.fromkeys(rov.coefficients, "A tank test")
    return Vehicle("An ROV", "an_rov", "1", "A test", "A tank", rov, sources, (0.1, 1.0), {}, None)
