"""How the vehicles that ship compare with what is published of them: the tables of vehicles.md."""

import csv
from collections.abc import Callable, Iterable
from dataclasses import replace
from decimal import Decimal
from math import degrees, hypot

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import TransferFunction, step

from rov_fmu.engine.simulation import simulate
from rov_fmu.model.layout import AXES, SURGE, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.published import Response, load_tables
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

Table = list[tuple[str, ...]]

NEWTON = 9.80665
"""In 1 kgf."""
OWN_THRUST = 30.4
"""Newton, of a thruster at full command by (18) of von Benzon et al."""
TRANSFER = (6136.0, 108700.0), (1.0, 89.0, 9258.0, 108700.0)
"""(19) of von Benzon et al., from commanded to actual thrust."""


def tables() -> dict[str, Table]:
    """By name."""
    ships = {name: load_vehicle(path) for name, path in SHIPPED.items()}
    six, eight = ships["bluerov2"], ships["bluerov2_heavy"]
    return {
        "videoray_printed": _printed(ships["videoray"]),
        "videoray_measured": _measured(ships["videoray"], ships["videoray_refit"]),
        "t200": _t200(six),
        "t200_lag": _lag(six),
        "sticks": _sticks(eight.layout),
        "top_speeds": _top_speeds(six, eight),
        "left_out": _left_out(eight),
    }


def _table(*columns: str) -> Table:
    return [columns, ("---",) * len(columns)]


# ---- VideoRay --------------------------------------------------------------------------------------------------------


def _furthest(deviations: Iterable[float | None]) -> str:
    known = [d for d in deviations if d is not None]
    return f"{max(known, key=abs):+.1%}" if known else "–"


def _printed(vehicle: Vehicle) -> Table:
    found = _table("", "V_ss, α = β = 1", "Tau, α = β = 1", "V_ss, scaled", "Tau, scaled")
    for t in load_tables(vehicle):
        models: list[Callable[[Response], float | None]] = [lambda r: r.V_ss.from_printed, lambda r: r.Tau.from_printed]
        cells = [_furthest(of(row.non_linear) for row in t.rows) for of in models]
        cells += [_furthest(of(row.scaled) for row in t.rows) for of in models]
        found.append((f"Table {t.number}, {t.axis.name}", *cells))
    return found


def _measured(paper: Vehicle, refit: Vehicle) -> Table:
    found = _table("", "V_ss, the paper's", "V_ss, refit", "Tau, the paper's", "Tau, refit")
    for t in load_tables(paper):
        cells = [
            _furthest(_off(t.response(v.rov, row.command)[n], measured(row)) for row in t.rows)
            for n, measured in enumerate((lambda row: row.scaled.V_ss.measured, lambda row: row.scaled.Tau.measured))
            for v in (paper, refit)
        ]
        found.append((t.axis.name, *cells))
    return found


def _off(value: float, measured: Decimal | None) -> float | None:
    return value / float(measured) - 1.0 if measured else None


# ---- T200 ------------------------------------------------------------------------------------------------------------


def makers_points() -> tuple[np.ndarray, np.ndarray]:
    """Command and thrust (N) of a T200 at 16 V."""
    with (SHIPPED["bluerov2"].parent / "t200" / "t200_16_v.csv").open(encoding="utf-8", newline="") as file:
        pulse, force = np.array([[float(cell) for cell in row] for row in [*csv.reader(file)][1:]]).T
    return (pulse - 1500.0) / 400.0, force * NEWTON


def symmetric() -> tuple[float, float]:
    """The one quadratic without dead band that fits both directions best: a_t, b_t."""
    c, thrust = makers_points()
    a, b = least_squares(lambda k: (k[0] * abs(c) + k[1]) * c - thrust, [20.0, 20.0]).x
    return float(a), float(b)


def _t200(vehicle: Vehicle) -> Table:
    c, thrust = makers_points()
    a, b = symmetric()
    curve = vehicle.layout.curves[0]
    models = {
        "shipped": np.array([vehicle.rov.curve_force(curve, float(x)) for x in c]),
        "one symmetric quadratic": (a * abs(c) + b) * c,
    }
    found = _table("", "RMS forward", "RMS in reverse", "furthest", "at 99 % forward")
    for name, model in models.items():
        off = model - thrust
        sides = [float(np.sqrt(np.mean(off[side] ** 2))) for side in (c > 0.0, c < 0.0)]
        cells = [f"{x:.2f} N" for x in (*sides, float(np.max(abs(off))))]
        found.append((name, *cells, f"{off[-1]:+.2f} N"))
    return found


def _lag(vehicle: Vehicle) -> Table:
    t = np.array([0.0, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.4])
    _, rise = step(TransferFunction(*TRANSFER), T=np.linspace(0.0, 0.4, 401))
    lag = 1.0 - np.exp(-t / vehicle.rov["T_t200"])
    found = _table("after", *(f"{x * 1e3:.0f} ms" for x in t[1:]))
    found.append(("published, third order", *(f"{rise[round(x * 1e3)]:.0%}" for x in t[1:])))
    found.append(("shipped, first order", *(f"{x:.0%}" for x in lag[1:])))
    return found


# ---- BlueROV2 --------------------------------------------------------------------------------------------------------


def _sticks(layout: Layout) -> Table:
    found = _table("stick", *(f"`u_{thruster.name}`" for thruster in layout.thrusters))
    for axis in AXES.values():
        signs = layout.signs(axis)
        cells = [{1.0: "+", -1.0: "−"}.get(signs.get(f"u_{thruster.name}", 0.0), "") for thruster in layout.thrusters]
        found.append((f"{axis.name}, {axis.positive}", *cells))
    return found


def _top_speeds(six: Vehicle, eight: Vehicle) -> Table:
    found = _table("full command", six.name, eight.name)
    for axis in AXES.values():
        for command, way in ((1.0, axis.positive), (-1.0, axis.negative)):
            speeds = [abs(v.rov.response(axis, command)[0]) for v in (six, eight)]
            found.append((f"{axis.name}, {way}", *(f"{speed:.2f} {axis.unit}" for speed in speeds)))
    thrust = sum(abs(thruster.effect(SURGE)) * OWN_THRUST for thruster in eight.layout.thrusters)
    own = eight.rov.acceleration_of(eight.layout.kinds[SURGE.name], thrust).steady_velocity()
    found.append((f"surge, {SURGE.positive}, with {OWN_THRUST} N a thruster", "", f"{own:.2f} m/s"))
    return found


MANOEUVRE = [
    (5.0, (0.6, 0.0, 0.0, 0.0)),
    (3.0, (0.4, 0.0, 0.2, 0.3)),
    (4.0, (0.0, 0.5, 0.0, 0.0)),
    (3.0, (0.5, 0.0, -0.25, 0.0)),
    (4.0, (-0.5, 0.0, 0.0, -0.4)),
    (3.0, (0.0, -0.4, 0.15, 0.0)),
    (5.0, (0.7, 0.0, 0.0, 0.0)),
    (3.0, (0.0, 0.0, 0.0, 0.0)),
]
"""Seconds, and the sticks held: surge, sway, yaw, heave."""


def fly(rov: Rov) -> tuple[dict[str, float], float]:
    """Return where the manoeuvre ends, and the length of the track in the plane (m)."""
    layout = rov.layout
    sticks = [layout.signs(AXES[name]) for name in ("surge", "sway", "yaw", "heave")]
    inputs: dict[str, list[float]] = {name: [] for name in layout.commands}
    for seconds, held in MANOEUVRE:
        for name in inputs:
            value = sum(signs.get(name, 0.0) * stick for signs, stick in zip(sticks, held, strict=True))
            inputs[name] += round(seconds * 10.0) * [value]
    steps = len(inputs[next(iter(inputs))])
    times = 0.1 * np.arange(steps + 1)
    states = simulate(rov, times, {name: [*command, 0.0] for name, command in inputs.items()}).values[:, 0]
    found = dict(zip(layout.state, states, strict=True))
    way = np.sum(np.hypot(np.diff(found["x"]), np.diff(found["y"])))
    return {name: float(values[-1]) for name, values in found.items()}, float(way)


def without(rov: Rov, *, coupling: bool = False, lag: bool = False, shape: bool = False) -> Rov:
    """The vehicle without its coupling, without its lag, with one symmetric quadratic for its thrust."""
    (curve,) = rov.layout.curves
    values = dict(rov.coefficients)
    keys = curve.keys
    if shape:
        keys = tuple(key for key in keys if key in {"a_t", "b_t", "T"})
        values |= zip((curve.coefficient("a_t"), curve.coefficient("b_t")), symmetric(), strict=True)
    if lag:
        keys = tuple(key for key in keys if key != "T")
    layout = replace(rov.layout, curves=(replace(curve, keys=keys),), coupled=rov.layout.coupled and not coupling)
    return Rov(layout, {name: values[name] for name in layout.coefficients})


def _left_out(vehicle: Vehicle) -> Table:
    whole, way = fly(vehicle.rov)
    found = _table("left out", "position", "heading", "depth")
    cases = {
        "asymmetry and dead band of the thrust": without(vehicle.rov, shape=True),
        "coupling of surge, sway and yaw": without(vehicle.rov, coupling=True),
        "lag of the thrust": without(vehicle.rov, lag=True),
        "all three": without(vehicle.rov, coupling=True, lag=True, shape=True),
    }
    for name, rov in cases.items():
        end, _ = fly(rov)
        x, y, z, psi = (end[key] - whole[key] for key in ("x", "y", "z", "psi"))
        found.append((name, f"{hypot(x, y):.2f} m", f"{degrees(psi):+.1f}°", f"{z:+.2f} m"))
    found.append((f"length of the track: {way:.1f} m", "", "", ""))
    return found
