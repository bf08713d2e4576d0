"""How the vehicles that ship compare with what is published of them: the tables of vehicles.md."""

import csv
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from math import degrees
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import AXES, PITCH, ROLL, SURGE
from rov_fmu.equation.layout import Layout
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.published import Response, load_tables

Table = list[tuple[str, ...]]

NEWTON = 9.80665
"""In 1 kgf."""
OWN_THRUST = 30.4
"""Newton, of a thruster at full command by (18) of von Benzon et al."""


@dataclass(frozen=True)
class Publication:
    """Coefficients as programs print them that cite a publication, each of six axes: u, v, w, p, q, r."""

    axes: str
    """Those that ship."""
    mass: tuple[float, ...]
    added_mass: tuple[float, ...]
    linear: tuple[float, ...]
    quadratic: tuple[float, ...]
    weight: float
    buoyancy: float
    above: float
    """The centre of buoyancy above the centre of mass, m."""


WU = Publication(
    "uvwr",
    (11.5, 11.5, 11.5, 0.16, 0.16, 0.16),
    (5.5, 12.7, 14.57, 0.12, 0.12, 0.12),
    (4.03, 6.22, 5.18, 0.07, 0.07, 0.07),
    (18.18, 21.66, 36.99, 1.55, 1.55, 1.55),
    112.8,
    114.8,
    0.02,
)
VON_BENZON = Publication(
    "uvwpqr",
    (13.5, 13.5, 13.5, 0.26, 0.23, 0.37),
    (6.36, 7.12, 18.68, 0.189, 0.135, 0.222),
    (13.7, 0.0, 33.0, 0.0, 0.8, 0.0),
    (141.0, 217.0, 190.0, 1.19, 0.47, 1.5),
    9.82 * 13.5,
    9.82 * 1000.0 * 0.0134,
    0.01,
)


@cache
def tables() -> dict[str, Table]:
    """By name."""
    ships = {name: load_vehicle(path) for name, path in SHIPPED.items()}
    six, eight = ships["bluerov2"], ships["bluerov2_heavy"]
    return {
        "videoray_printed": _printed(ships["videoray"]),
        "videoray_measured": _measured(ships["videoray"], ships["videoray_refit"]),
        "t200": _t200(six),
        "sticks": _sticks(eight.layout),
        "top_speeds": _top_speeds(six, eight),
        "tilting": _tilting(eight),
    }


# ---- VideoRay --------------------------------------------------------------------------------------------------------


def _furthest(deviations: Iterable[float | None]) -> str:
    known = [d for d in deviations if d is not None]
    return f"{max(known, key=abs):+.1%}" if known else "–"


def _printed(vehicle: Vehicle) -> Table:
    found: Table = [("", "V_ss, α = β = 1", "Tau, α = β = 1", "V_ss, scaled", "Tau, scaled")]
    for t in load_tables(vehicle):
        models: list[Callable[[Response], float | None]] = [lambda r: r.V_ss.from_printed, lambda r: r.Tau.from_printed]
        cells = [_furthest(of(row.non_linear) for row in t.rows) for of in models]
        cells += [_furthest(of(row.scaled) for row in t.rows) for of in models]
        found.append((f"Table {t.number}, {t.axis.name}", *cells))
    return found


def _measured(paper: Vehicle, refit: Vehicle) -> Table:
    found: Table = [("", "V_ss, the paper's", "V_ss, refit", "Tau, the paper's", "Tau, refit")]
    quantities: list[Callable[[Response], Decimal | None]] = [lambda r: r.V_ss.measured, lambda r: r.Tau.measured]
    for t in load_tables(paper):
        cells = [
            _furthest(_off(t.response(v, row.command)[n], measured(row.scaled)) for row in t.rows)
            for n, measured in enumerate(quantities)
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
        "shipped": np.array([vehicle.curve_force(curve, float(x)) for x in c]),
        "one symmetric quadratic": (a * abs(c) + b) * c,
    }
    found: Table = [("", "RMS forward", "RMS in reverse", "furthest", "at 99 % forward")]
    for name, model in models.items():
        off = model - thrust
        sides = [float(np.sqrt(np.mean(off[side] ** 2))) for side in (c > 0.0, c < 0.0)]
        cells = [f"{x:.2f} N" for x in (*sides, float(np.max(abs(off))))]
        found.append((name, *cells, f"{off[-1]:+.2f} N"))
    return found


# ---- BlueROV2 --------------------------------------------------------------------------------------------------------


def _sticks(layout: Layout) -> Table:
    found: Table = [("stick", *(f"`u_{thruster.name}`" for thruster in layout.thrusters))]
    for axis in AXES.values():
        signs = layout.signs(axis)
        if axis in (ROLL, PITCH):  # ArduSub rolls and pitches with the vertical thrusters alone
            signs = {f"u_{t.name}": signs[f"u_{t.name}"] for t in layout.thrusters if t.direction.value[2]}
        cells = [{1.0: "+", -1.0: "−"}.get(signs.get(f"u_{thruster.name}", 0.0), "") for thruster in layout.thrusters]
        found.append((f"{axis.name}, {axis.positive}", *cells))
    return found


def _top_speeds(six: Vehicle, eight: Vehicle) -> Table:
    found: Table = [("full command", six.name, eight.name)]
    for axis in (form.axis for form in six.layout.axes):
        for command, way in ((1.0, axis.positive), (-1.0, axis.negative)):
            speeds = [abs(v.response(axis, command)[0]) for v in (six, eight)]
            found.append((f"{axis.name}, {way}", *(f"{speed:.2f} {axis.unit}" for speed in speeds)))
    thrust = sum(abs(thruster.effect(SURGE)) * OWN_THRUST for thruster in eight.layout.thrusters)
    full = eight.motion_at(SURGE, 1.0)
    own = replace(full, C=full.C * thrust / eight.force(SURGE, 1.0)).steady_velocity()
    found.append((f"surge, {SURGE.positive}, with {OWN_THRUST} N a thruster", "", f"{own:.2f} m/s"))
    return found


def run(rov: Vehicle, times: np.ndarray, values: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the states and the attitude over time."""
    layout = rov.layout
    record = [*layout.state, *(name for name in ("phi", "theta", "psi") if name in layout.calculated)]
    return dict(zip(record, simulate(rov, times, values, record).values[:, 0], strict=True))


AHEAD = (0.1, 0.2, 0.3, 0.5, 1.0)
"""Commands."""


def _tilting(eight: Vehicle) -> Table:
    """How far vehicles without control tilt under thrust ahead, deep under water."""
    found: Table = [("thrust ahead for 30 s", *(f"{command:.0%}" for command in AHEAD))]
    cases = {
        "Heavy": eight,
        "Heavy, buoyancy 5 cm above": eight.with_(z_B=-0.05),
    }
    for title, rov in cases.items():
        cells = []
        for command in AHEAD:
            inputs = {name: sign * command for name, sign in rov.layout.signs(SURGE).items()}
            moved = run(rov, 0.1 * np.arange(301), {"z": 100.0, **inputs})
            tilt = degrees(float(np.max(np.arccos(np.cos(moved["phi"]) * np.cos(moved["theta"])))))
            cells.append(f"{tilt:.0f}°" if tilt < 90.0 else "turns over")
        found.append((title, *cells))
    return found
