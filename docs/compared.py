"""How the vehicles that ship compare with what is published of them: the tables of vehicles.md."""

import csv
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from math import degrees, hypot, radians
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import TransferFunction, step

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import AXES, HEAVE, PITCH, ROLL, SURGE
from rov_fmu.equation.layout import Layout, Thruster, VehicleAxis
from rov_fmu.vehicle.published import Response, load_tables
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.references.rigid_body import Body, euler_angles, integrate, quaternion_of, rotation, zeros

Table = list[tuple[str, ...]]

NEWTON = 9.80665
"""In 1 kgf."""
OWN_THRUST = 30.4
"""Newton, of a thruster at full command by (18) of von Benzon et al."""
TRANSFER = (6136.0, 108700.0), (1.0, 89.0, 9258.0, 108700.0)
"""(19) of von Benzon et al., from commanded to actual thrust."""


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

    def body(self, load: tuple[float, ...]) -> Body:
        """The vehicle in the reference, without thrusters."""
        M, D, D_q = zeros(), zeros(), zeros()
        for i in range(6):
            M[i][i] = self.mass[i] + self.added_mass[i]
            D[i][i], D_q[i][i] = self.linear[i], self.quadratic[i]
        return Body(
            self.axes,
            mass=M,
            linear=D,
            linear_astern=D,
            ahead=D_q,
            astern=D_q,
            load=load,
            weight=self.weight,
            buoyancy=self.buoyancy,
            centre_of_buoyancy=(0.0, 0.0, -self.above),
        )


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
        "t200_lag": _lag(six),
        "sticks": _sticks(eight.layout),
        "top_speeds": _top_speeds(six, eight),
        "published_motion": _published_motion(six, eight),
        "tilting": _tilting(six, eight),
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
            _furthest(_off(t.response(v, row.command)[n], measured(row)) for row in t.rows)
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
        "shipped": np.array([vehicle.curve_force(curve, float(x)) for x in c]),
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
    lag = 1.0 - np.exp(-t / vehicle["T_t200"])
    found = _table("after", *(f"{x * 1e3:.0f} ms" for x in t[1:]))
    found.append(("published, third order", *(f"{rise[round(x * 1e3)]:.0%}" for x in t[1:])))
    found.append(("shipped, first order", *(f"{x:.0%}" for x in lag[1:])))
    return found


# ---- BlueROV2 --------------------------------------------------------------------------------------------------------


def _sticks(layout: Layout) -> Table:
    found = _table("stick", *(f"`u_{thruster.name}`" for thruster in layout.thrusters))
    for axis in AXES.values():
        signs = layout.signs(axis)
        if axis in (ROLL, PITCH):  # ArduSub rolls and pitches with the vertical thrusters alone
            signs = {f"u_{t.name}": signs[f"u_{t.name}"] for t in layout.thrusters if t.direction.value[2]}
        cells = [{1.0: "+", -1.0: "−"}.get(signs.get(f"u_{thruster.name}", 0.0), "") for thruster in layout.thrusters]
        found.append((f"{axis.name}, {axis.positive}", *cells))
    return found


def _top_speeds(six: Vehicle, eight: Vehicle) -> Table:
    found = _table("full command", six.name, eight.name)
    for axis in (form.axis for form in six.layout.axes):
        for command, way in ((1.0, axis.positive), (-1.0, axis.negative)):
            speeds = [abs(v.response(axis, command)[0]) for v in (six, eight)]
            found.append((f"{axis.name}, {way}", *(f"{speed:.2f} {axis.unit}" for speed in speeds)))
    thrust = sum(abs(thruster.effect(SURGE)) * OWN_THRUST for thruster in eight.layout.thrusters)
    full = eight.held(SURGE, 1.0)
    own = replace(full, C=full.C * thrust / eight.force(SURGE, 1.0)).steady_velocity()
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


LEVEL = -1.0
"""The z_B of a vehicle that stays level, as if an autopilot held it."""


def fly(rov: Vehicle) -> tuple[dict[str, float], float]:
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
    found = run(rov, times, {name: [*command, 0.0] for name, command in inputs.items()})
    way = np.sum(np.hypot(np.diff(found["x"]), np.diff(found["y"])))
    return {name: float(values[-1]) for name, values in found.items()}, float(way)


def run(rov: Vehicle, times: np.ndarray, values: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the states and the attitude over time."""
    layout = rov.layout
    record = [*layout.state, *(name for name in ("phi", "theta", "psi") if name in layout.calculated)]
    return dict(zip(record, simulate(rov, times, values, record).values[:, 0], strict=True))


def without(rov: Vehicle, *, coupling: bool = False, lag: bool = False, shape: bool = False) -> Vehicle:
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
    return Vehicle(layout, {name: values[name] for name in layout.coefficients})


def _left_out(vehicle: Vehicle) -> Table:
    level = vehicle.replaced({"z_B": LEVEL})
    whole, way = fly(level)
    found = _table("left out", "position", "heading", "depth")
    cases = {
        "asymmetry and dead band of the thrust": without(level, shape=True),
        "Coriolis and Munk terms": without(level, coupling=True),
        "lag of the thrust": without(level, lag=True),
        "all three": without(level, coupling=True, lag=True, shape=True),
        "the autopilot, with buoyancy 5 cm above the centre of mass": vehicle.replaced({"z_B": -0.05}),
        "the autopilot": vehicle,
    }
    for name, rov in cases.items():
        end, _ = fly(rov)
        x, y, z, psi = (end[key] - whole[key] for key in ("x", "y", "z", "psi"))
        found.append((name, f"{hypot(x, y):.2f} m", f"{degrees(psi):+.1f}°", f"{z:+.2f} m"))
    found.append((f"length of the track: {way:.1f} m", "", "", ""))
    return found


# ---- Roll and pitch --------------------------------------------------------------------------------------------------

AFTER = (0.5, 1.0, 2.0, 5.0)
"""Seconds at which motions are compared."""
ROUNDING = 1e-12
"""Motions that differ by less, in rad or m/s, are the same."""


def _published_motion(six: Vehicle, eight: Vehicle) -> Table:
    """Motions without thrust, by the published numbers in the reference and by the C of the vehicle that ships."""
    found = _table("", "", *(f"{t:g} s" for t in AFTER), "furthest")
    pushed = {"X_ext": 10.0, "Y_ext": 5.0, "N_ext": 0.3}
    cases: list[tuple[str, Vehicle, Publication, tuple[float, float], Mapping[str, float], str]] = [
        ("BlueROV2, pushed ahead, aside and around", six, WU, (0.0, 0.0), pushed, "v"),
        ("Heavy, pushed likewise", eight, VON_BENZON, (0.0, 0.0), pushed, "v"),
        ("Heavy, let go at 30° of roll", eight, VON_BENZON, (radians(30.0), 0.0), {}, "phi"),
        ("Heavy, let go at 30° of pitch", eight, VON_BENZON, (0.0, radians(30.0)), {}, "theta"),
        ("Heavy, 1 N.m bow up", eight, VON_BENZON, (0.0, 0.0), {"M_ext": 1.0}, "theta"),
    ]
    for title, vehicle, published, (phi, theta), loads, name in cases:
        load = tuple(loads.get(axis.external, 0.0) for axis in AXES.values())
        state = [*(6 * [0.0]), *map(float, quaternion_of(phi, theta, 0.0)), *(3 * [0.0])]
        wanted, at = [], 0.0
        for t in AFTER:
            state, at = list(integrate(published.body(load), state, t - at)), t
            angles = dict(zip(("phi", "theta", "psi"), euler_angles(rotation(state[6:10])), strict=True))
            wanted.append(float({**dict(zip("uvwpqr", state, strict=False)), **angles}[name]))
        start = {"phi_0": phi, "theta_0": theta} if vehicle.layout.has_attitude else {}
        moved = run(vehicle, np.array([0.0, *AFTER]), {**loads, **start})[name][1:]
        scale, unit = (degrees(1.0), "°") if name in ("phi", "theta") else (1.0, " m/s")
        cells = [f"{scale * value:.3f}{unit}" for value in wanted]
        furthest = max(
            abs(a - b) for a, b in zip(moved, wanted, strict=True)
        )  # rounding errors, which differ by machine
        below = f"below {ROUNDING:g}" if furthest < ROUNDING else f"{furthest:.0e}"
        found.append((title, {"v": "sway v", "phi": "roll φ", "theta": "pitch θ"}[name], *cells, below))
    return found


def _at_depth(thruster: Thruster, z: float) -> Thruster:
    """Return a thruster at another height relative to the centre of mass (m)."""
    assert thruster.position
    position = thruster.position.model_copy(update={"value": (*thruster.place[:2], z)})
    return thruster.model_copy(update={"position": position})


def of_wu(rov: Vehicle, below: float, above: float) -> Vehicle:
    """The BlueROV2 with Wu's roll and pitch: thrusters below, and buoyancy above the centre of mass (m)."""
    layout = rov.layout
    forms = {form.axis: replace(form, keys=tuple(key for key in form.keys if key != "F_0")) for form in layout.axes}
    forms |= {axis: VehicleAxis(axis, forms[HEAVE].keys) for axis in (ROLL, PITCH)}
    thrusters = tuple(_at_depth(t, below) if t.position and not t.direction.value[2] else t for t in layout.thrusters)
    axes = tuple(forms[axis] for axis in AXES.values())
    layout = replace(layout, axes=axes, thrusters=thrusters, restoring=("W", "B", "z_B"))
    values = {**rov.coefficients, "W": WU.weight, "B": WU.buoyancy, "z_B": -above}
    for axis in (ROLL, PITCH):
        i = list(AXES.values()).index(axis)
        values[axis.inertia] = WU.mass[i]
        rows = {"m_a": WU.added_mass, "b_d": WU.linear, "a_d": WU.quadratic, "alpha": 6 * (1.0,), "beta": 6 * (1.0,)}
        values |= {axis.coefficient(key): row[i] for key, row in rows.items()}
    return Vehicle(layout, {name: values[name] for name in layout.coefficients})


AHEAD = (0.1, 0.2, 0.3, 0.5, 1.0)
"""Commands."""


def _tilting(six: Vehicle, eight: Vehicle) -> Table:
    """How far vehicles without control tilt under thrust ahead."""
    found = _table("thrust ahead for 30 s", *(f"{command:.0%}" for command in AHEAD))
    cases = {
        "Heavy": eight,
        "Heavy, buoyancy 5 cm above": eight.replaced({"z_B": -0.05}),
        "Wu's roll and pitch: thrusters 8.5 cm below, buoyancy 2 cm above": of_wu(six, 0.085, WU.above),
        "the same with thrusters at the centre of mass": of_wu(six, 0.0, WU.above),
        "the same with the heights of bluerov2_gz: 1.1 cm below, 4.9 cm above": of_wu(six, 0.011, 0.049),
    }
    for title, rov in cases.items():
        cells = []
        for command in AHEAD:
            inputs = {name: sign * command for name, sign in rov.layout.signs(SURGE).items()}
            moved = run(rov, 0.1 * np.arange(301), inputs)
            tilt = degrees(float(np.max(np.arccos(np.cos(moved["phi"]) * np.cos(moved["theta"])))))
            cells.append(f"{tilt:.0f}°" if tilt < 90.0 else "turns over")
        found.append((title, *cells))
    return found
