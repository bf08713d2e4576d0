"""A small result of an identification, made by hand: three axes, two logs, and numbers that are plainly synthetic.

Surge is good, heave usable, and yaw must not be used. Every number is round, so that tests can name it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.identify.findings import told
from rov_fmu.identify.result import (
    Answer,
    AxisResult,
    Disturbance,
    Identification,
    IdentifiedCoefficient,
    IdentifiedEffect,
    Logging,
    MeasuredPoint,
    Prediction,
    SensorNoise,
    Slip,
    Verdict,
)
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.description import NO_ROV_FILE
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.folder import Folder
from rov_fmu.tank.log import Channel, Commands, Log, Source
from rov_fmu.tank.readers.tank_tables import Row
from rov_fmu.vehicle.description import Provenance
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import with_intervals

FILES = ("log_1.csv", "log_2.csv")
TIME = np.arange(0.0, 60.0, 0.1)


def prediction(
    axis: Axis, quantity: str, file: str = FILES[1], *, error: float = 0.1, span: float = inf, coverage: float = 0.95
) -> Prediction:
    """Return the prediction of a sine by one that is off by another sine with this RMS error."""
    measured = np.sin(0.2 * TIME)
    off = error * np.sqrt(2.0) * np.sin(0.5 * TIME)
    is_position = not quantity.endswith("velocity")
    deviation = 0.3 / (1.2 - coverage) * error * (0.5 + 1.0 * (TIME % min(span, 60.0)) / 60.0)
    unit = axis.position_unit if is_position else axis.unit
    noise, unchanged = 0.01, 0.7
    errors = unchanged, noise, error, coverage, -4.6
    data = TIME, measured, measured + off, deviation
    return Prediction(axis, file, quantity, unit, is_position, span, "the other log", *data, *errors)


def answers(scale: float, share: float) -> tuple[Answer, ...]:
    """Return answers for commands of both signs, with intervals of this share."""

    def known(value: float) -> tuple[float, tuple[float, float]]:
        low, high = sorted((value * (1.0 - share), value * (1.0 + share)))
        return value, (low, high)

    def answer(c: float) -> Answer:
        V = scale * c
        return Answer(SURGE, c, known(V), known(0.5 / abs(c)), known(2.0 * V))

    return tuple(map(answer, (-1.0, -0.5, -0.3, 0.3, 0.5, 1.0)))


def axis_result(
    axis: Axis, verdict: Verdict, predictions: Sequence[Prediction], *, scale: float = 1.0, share: float = 0.02
) -> AxisResult:
    """Return an axis whose V_ss is `scale` times the command."""
    name = axis.coefficient
    known = (
        IdentifiedCoefficient(name("a_d"), 10.0, (9.0, 11.0), "N.s2/m2", "20 within a factor of 2, from the base", 0.1),
        IdentifiedCoefficient(name("b_d"), 2.0, (0.5, 3.5), "N.s/m", "4 within a factor of 3, from the base", 0.4),
        IdentifiedCoefficient(name("beta"), 0.8, (0.7, 0.9), "1", "0.65 within a factor of 1.5", 0.2),
    )
    points = (
        MeasuredPoint(
            axis.name, "V_ss", axis.unit, "steady.csv", 0.3, 0.29 * scale, 0.3 * scale, 0.31 * scale, counts=True
        ),
        MeasuredPoint(
            axis.name, "V_ss", axis.unit, "steady.csv", 0.5, 0.51 * scale, 0.5 * scale, 0.5 * scale, counts=True
        ),
        MeasuredPoint(axis.name, "Tau", "s", "times.csv", 0.5, 1.1, 1.0, 1.0, counts=False),
    )
    own = tuple(replace(answer, axis=axis) for answer in answers(scale, share))
    return AxisResult(axis, verdict, own, (0.7, 0.7), known, tuple(predictions), points)


GOOD = Verdict("good", ("The bands contain 95 % of the unseen data",))
USABLE = Verdict("usable", ("The intervals of V_ss are wider than 5 %",))
BAD = Verdict("do not use", ("The bands contain only 40 % of the unseen data.", "Two starts disagree"))


def log(file: str, *, full: float = 0.0) -> Log:
    """Return a log of a minute, in which one thruster has the full command for a share of the time."""
    commands = np.where(full > TIME / 60.0, 1.0, 0.5)[:, None]
    channels = (Channel(QUANTITIES["depth"], Source("depth"), TIME, np.sin(0.2 * TIME), file),)
    return Log(file, Commands.of_rows(["t"], TIME, commands, Source("t")), channels)


def disturbance(
    kind: str, axis: Axis | None, file: str, size: float, unit: str, share: float, evidence: float
) -> Disturbance:
    """Return a slow process with a size that is known within a tenth."""
    interval = 0.9 * size, 1.1 * size
    of = axis.name if axis else ""
    return Disturbance(kind, of, kind, size, interval, unit, evidence, axis=axis, file=file, share=share)


@cache
def without_findings() -> Identification:
    """Return the result before anything is told about it."""
    base = load_vehicle(VIDEORAY)
    vehicle = replace(
        with_intervals(base, {"a_d_u": (9.0, 11.0)}),
        name="Tadpole",
        identifier="tadpole",
        version="1",
        description="A small ROV that exists only in tests",
        source="Two dives in a pond",
        provenance=Provenance(tool="rov-fmu", method="A result made by hand", inputs={}),
        measured_from="two dive logs",
        data=None,
        pictures=None,
    )
    axes = (
        axis_result(
            SURGE,
            GOOD,
            [prediction(SURGE, "distance", span=10.0, error=0.05), prediction(SURGE, "surge velocity", error=0.05)],
        ),
        axis_result(HEAVE, USABLE, [prediction(HEAVE, "depth", span=10.0, coverage=0.9)], scale=0.5, share=0.1),
        axis_result(
            YAW, BAD, [prediction(YAW, "heading", span=10.0, error=0.9, coverage=0.4)], scale=pi / 2.0, share=0.3
        ),
    )
    forces = tuple(
        MeasuredPoint("top", "force", "N", "thrust_top.csv", c, 10.0 * c, 10.5 * c, 10.2 * c, counts=c > 0.2)
        for c in (0.2, 0.4, 0.6)
    )
    names = tuple(known.name for result in axes for known in result.known)
    correlation = np.eye(len(names))
    correlation[0, 1] = correlation[1, 0] = -0.9
    findings = [Finding("rows sorted", file=FILES[0], words={"count": 3.0})]
    rows: dict[tuple[str, str], list[Row]] = {("steady", result.axis.name): [] for result in axes}
    inputs = {"rov.toml": "0" * 64, FILES[0]: "1" * 64, FILES[1]: "2" * 64, "thrust_top.csv": "3" * 64}
    return Identification(
        folder=Folder(Path("pond"), NO_ROV_FILE, logs=[*map(log, FILES)], inputs=inputs, findings=findings, rows=rows),
        vehicle=vehicle,
        axes=axes,
        curves={
            "top": (IdentifiedCoefficient("b_t_top", 10.0, (9.0, 11.0), "N", "11 within 10 %, from the forces", 0.9),)
        },
        forces=forces,
        effects=(
            IdentifiedEffect("lag", "top", "lag of the thrusters", 0.12, (0.11, 0.13), "s", 50.0),
            IdentifiedEffect("current", FILES[0], "current to the north", 0.1, (0.09, 0.11), "m/s", 12.0),
            IdentifiedEffect("load", "heave", "constant load", 0.01, (-0.5, 0.5), "N", -3.0),
        ),
        disturbances=(
            disturbance("slow force", HEAVE, FILES[1], 2.1, "N", 0.16, 30.0),
            disturbance("slow gain", None, FILES[0], 0.01, "1", 0.01, 2.0),
        ),
        logging=(Logging(FILES[0], 0.1, -0.08, (-0.09, -0.07), 0.1), Logging(FILES[1], 0.1, 0.0, (-0.02, 0.02), 0.1)),
        sensors=(
            SensorNoise(HEAVE, "depth", "m", 0.01, 0.02, 1.5, 1200),
            SensorNoise(YAW, "heading", "rad", pi / 180.0, 0.0, 0.0, 1200),
        ),
        correlation=(names, correlation),
        objective=-1234.5,
    )


@cache
def example() -> Identification:
    """Return the result with all that is to be told about it."""
    return told(without_findings())


def bare() -> Identification:
    """A result of one axis without logs, tables, effects or anything else that a report shows."""
    result = without_findings()
    axis = AxisResult(SURGE, GOOD, tested=(0.0, 0.7))
    empty: dict[str, Any] = dict.fromkeys(("forces", "effects", "disturbances", "logging", "sensors"), ())
    folder = replace(result.folder, logs=[])
    correlation = (), result.correlation[1][:0, :0]
    return told(replace(result, axes=(axis,), curves={}, folder=folder, correlation=correlation, **empty))


def driven_by(names: Sequence[str]) -> Identification:
    """The example with some of the thrusters of its vehicle."""
    vehicle = without_findings().vehicle
    layout = vehicle.layout
    kept = replace(layout, thrusters=tuple(t for t in layout.thrusters if t.name in names))
    return told(replace(without_findings(), vehicle=vehicle.with_(kept)))


def doubtful() -> Identification:
    """The example with one rear thruster, an assumed thrust and a depth in cm in one of its logs."""
    curves = {"top": (IdentifiedCoefficient("a_t_top", 6.0, (5.0, 7.0), "N", "6.0 ± 1.0 N", 0.5),)}
    slips = (Slip(FILES[1], "depth", "is it in cm", 20.0),)
    return told(replace(driven_by(["l", "t"]), slips=slips, forces=(), curves=curves))
