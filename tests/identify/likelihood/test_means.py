"""Rows that are means of their intervals are told from those of a moment, and their commands and headings are read so.

The equations of motion stand here, written by hand and solved by SciPy's DOP853.
"""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.equation.catalogue import HEAVE, YAW
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.hypotheses import HYPOTHESES, applied
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.identify.likelihood.search import StructureFit, settled
from rov_fmu.identify.likelihood.solve import evidence, least_from, start_of
from rov_fmu.tank.arrays import Array

RAW, SECONDS = 20, 40.0
"""Samples of the sensors in a second, and how long a dive lasts, s."""
QUADRATIC, LINEAR, INERTIA = np.array([50.0, 1.6]), np.array([8.0, 0.4]), np.array([30.0, 0.5])
"""Of heave and of yaw."""
ROV = """
[vehicle]
name = "Logged"
identifier = "logged"
version = "1.0"
description = "A vehicle whose logger writes a table"
source = "Dives"

[body]
m_rov = { value = 20.0, unit = "kg", source = "Weighed" }
I_r = { value = 0.4, unit = "kg.m2", source = "Swung" }

[axes.heave]
[axes.yaw]
"""
HEADER = "time [s],Z_ext [N],N_ext [N.m],depth [m],heading [deg]"
KIND = "means of rows"


@dataclass(frozen=True, eq=False)
class Raw:
    """What sensors show, RAW times in a second."""

    push: Array
    """n x 2: the force down and the torque."""
    depth: Array
    heading: Array
    """rad, not wrapped."""
    shown: Array
    """rad, with noise, from 0 to a full turn."""


@cache
def raw(seed: int) -> Raw:
    """A dive from rest whose force and torque each hold for 3.1 to 5 s."""
    random, n = np.random.default_rng(seed), round(SECONDS * RAW)
    push = np.zeros((n, 2))
    for column, largest in enumerate((40.0, 1.5)):
        at = RAW
        while at < n:
            length = int(random.uniform(3.1, 5.0) * RAW)
            push[at : at + length, column] = largest * random.uniform(0.4, 1.0) * random.choice([-1.0, 1.0])
            at += length
    edges = [0, *(np.flatnonzero(np.diff(push, axis=0).any(axis=1)) + 1), n]
    states = [np.array([0.0, 0.0, 5.0, 0.1])]
    for first, last in pairwise(edges):

        def rates(_: float, y: Array, F: Array = push[first]) -> Array:
            v = y[:2]
            return np.concatenate([(F - QUADRATIC * np.abs(v) * v - LINEAR * v) / INERTIA, v])

        at_times = np.arange(last - first + 1) / RAW
        found = solve_ivp(rates, (0.0, at_times[-1]), states[-1], "DOP853", at_times, rtol=1e-8, atol=1e-10).y
        states += [*found.T[1:]]
    _, _, depth, heading = np.array(states[:-1]).T
    noise = random.normal(0.0, 0.01, (2, n))
    return Raw(push, depth + noise[0], heading, np.remainder(heading + noise[1], 2.0 * np.pi))


def of_rows(kind: str, rate: float, values: Array) -> Array:
    """The rows of a table: values of a moment, the last values that sensors sent, every 0.35 s, or means."""
    count = round(RAW / rate)
    if kind == "means":
        return np.asarray(values.reshape(-1, count, *values.shape[1:]).mean(axis=1))
    at = np.arange(0, len(values), count)
    return np.asarray(values[at if kind == "moments" else at // 7 * 7])


def table(folder: Path, kind: str, rate: float, seed: int = 0) -> SampledLog:
    """Write a table, and return what the filter reads of it."""
    one = raw(seed)
    columns = one.depth, np.degrees(one.shown)
    measured = [of_rows(kind, rate, column) for column in columns]
    push = of_rows("means" if kind == "means" else "moments", rate, one.push)
    rows = np.column_stack([np.arange(len(push)) / rate, push, *measured])
    np.savetxt(folder / "log_dive.csv", rows, "%.10g", ",", header=HEADER, comments="")
    (folder / "rov.toml").write_text(ROV, encoding="utf-8")
    (sampled,) = begin(load_tests(folder))[1]
    return sampled


def circular(angle: Array) -> Array:
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


@pytest.mark.parametrize("rate", [1.0, 2.0])
def test_a_command_that_changed_once_is_that_of_the_vehicle(rate: float, tmp_path: Path) -> None:
    """Its times follow from the means of its rows, which stay what they are."""
    sampled, count = table(tmp_path, "means", rate), round(RAW / rate)
    record, known = sampled.with_means().record, raw(0).push
    assert sampled.log.commands
    means = known.reshape(-1, count, 2).mean(axis=1)
    names = [[*sampled.layout.inputs].index(f"u_{name}") for name in sampled.log.commands.thrusters]
    commands = record.inputs[:, names] * np.abs(means).max(axis=0)
    ends = np.append(record.told, SECONDS)
    integral = np.vstack([[0.0, 0.0], np.cumsum(commands * np.diff(ends)[:, None], axis=0)])
    of_rows = [np.diff(np.interp(np.arange(len(means) + 1) / rate, ends, one)) * rate for one in integral.T]
    assert np.transpose(of_rows) == pytest.approx(means, abs=1e-6)
    times = np.arange(0.5 / RAW, SECONDS, 1.0 / RAW)  # the middles of the samples, in which commands hold
    found = commands[np.searchsorted(record.told, times, side="right") - 1]
    assert np.mean(np.abs(found - known) < 1e-6) > 0.95


@pytest.mark.parametrize("rate", [1.0, 2.0])
def test_headings_that_were_averaged_across_north_are_left_out(rate: float, tmp_path: Path) -> None:
    sampled, count = table(tmp_path, "means", rate), round(RAW / rate)
    (before,), (after,) = (
        [m.channel for m in one.measured if m.sensor.axis is YAW] for one in (sampled, sampled.with_means())
    )
    true = raw(0).heading.reshape(-1, count).mean(axis=1)
    wrong = np.abs(circular(before.values - true))
    left = np.isin(before.time, after.time)
    assert wrong.max() > 0.5, "some are averaged across north"
    assert wrong[left].max() < 0.02
    assert left.mean() > 0.4
    depth, other = (
        next(m.channel.time for m in one.measured if m.sensor.axis is HEAVE) for one in (sampled, sampled.with_means())
    )
    assert np.array_equal(depth, other), "a depth has no north"


@pytest.mark.parametrize(("kind", "rate"), [("moments", 2.0), ("means", 1.0)])
def test_rows_are_told(kind: str, rate: float, tmp_path: Path) -> None:
    """J tells whether rows are means, and with means, the drag and the inertia are those of the simulation."""
    table(tmp_path, kind, rate)
    (tmp_path / "rov.toml").write_text(ROV.replace("[axes.yaw]", ""), encoding="utf-8")
    plain = Objective.of_known(*begin(load_tests(tmp_path)))
    end = least_from(plain, start_of(plain))
    score = evidence(plain, end)
    fit, odds = settled(StructureFit({}, plain, end, score, score))
    assert [*odds] == [(KIND, ("log_dive.csv",))] * (kind == "means")
    if odds:
        found, v = fit.objective.table.coefficients(fit.minimum.z), 0.7
        assert found["a_d_w"] * v + found["b_d_w"] == pytest.approx(QUADRATIC[0] * v + LINEAR[0], rel=0.05)
        assert found["beta_w"] == pytest.approx(20.0 / INERTIA[0], rel=0.05)


def test_only_tables_of_far_rows_may_be_means(tmp_path: Path) -> None:
    for rate, is_slow in ((2.0, True), (5.0, False), (10.0, False)):
        sampled = table(tmp_path, "moments", rate)
        assert sampled.is_slow_table == is_slow
        model = Objective.of_known(*begin(load_tests(tmp_path))[:2], [])
        suspects = [*HYPOTHESES[KIND].suspects(model.table.known, model.logs)]
        assert suspects == [("log_dive.csv",)] * is_slow
        for of in suspects:
            (changed,) = applied(model, {(KIND, of): None}).logs
            assert changed.has_means
            assert not changed.lost
