"""The objective J: its derivatives, the parts that logs and tables have in it, and what counts less or not at all."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood import parameters
from rov_fmu.identify.likelihood.filter import DivergedError, Filter, FilterRun, Parameters, Record
from rov_fmu.identify.likelihood.objective import DataPart, Objective
from rov_fmu.identify.likelihood.parameters import Parameter
from rov_fmu.identify.likelihood.solve import minimise, refits, start_of, total_information
from rov_fmu.tank.arrays import Array
from tests.folders import folder_of, pulled, responses
from tests.identify.conftest import KNOWN, add_voltage
from tests.identify.likelihood.sets import one_set
from tests.recordings import run, write_log
from tests.vehicles import VIDEORAY

PLAN = ((0.0, 2.0), (0.4, 5.0), (-0.5, 4.0), (0.2, 2.0))


@pytest.fixture(scope="module")
def objective(tmp_path_factory: pytest.TempPathFactory) -> Objective:
    """Return J for a short log of heave, two of yaw, and all tables of heave, of a vehicle with a curve that bends."""
    tables = {**responses(VIDEORAY, HEAVE), "thrust_top.csv": pulled(6.5, 0.05), "thrust_rear.csv": pulled(43.0, 2.7)}
    path = folder_of(tmp_path_factory.mktemp("tests"), KNOWN, tables)
    random = np.random.default_rng(0)
    for n, axis in enumerate((HEAVE, YAW, YAW)):
        write_log(path, str(n), run(VIDEORAY, axis, PLAN, 5.0).noisy(random))
    known, logs, rows = begin(load_tests(path))
    return Objective.of_known(known, logs, rows)


@pytest.fixture(scope="module")
def point(objective: Objective) -> Array:
    """Return parameters near the minimum, inside of their bounds. Outliers have kinks, and there is none.

    No width is so near 0 that its derivative compares it with none.
    """
    louder = np.array([2.0 * (p.kind == "slow force") for p in objective.table.parameters])
    found = minimise(objective, objective.mean + louder * objective.deviation)
    root = np.linalg.cholesky(np.linalg.inv(found.information / 2.0))
    z = found.z + 0.3 * root @ np.random.default_rng(2).standard_normal(len(root))
    inside = np.where([p.kind == "logging width" for p in objective.table.parameters], 0.4, 0.01) * objective.deviation
    z = np.clip(z, objective.low + inside, objective.high - inside)
    assert all(np.abs(one.innovations / np.sqrt(one.variances)).max() < 3.9 for one in objective.runs(z))
    return np.asarray(z, float)


def test_quadratic_drag_is_that_of_the_model_without_another_power(objective: Objective, point: Array) -> None:
    """J without the prior of q is equal at q = 0, and almost equal next to it."""
    powers = [n for n, p in enumerate(objective.table.parameters) if p.kind.startswith("power of drag")]
    assert len(powers) == 4
    rest = tuple(p for p in objective.table.parameters if not p.kind.startswith("power of drag"))
    plain = Objective(replace(objective.table, parameters=rest), objective.logs, objective.rows)
    without = np.delete(point, powers)
    runs = plain.runs(without)
    J = plain.value(without, runs)
    for q in (0.0, 1e-11, -1e-11):
        z = point.copy()
        z[powers] = q
        own = objective.runs(z, runs)
        assert objective.value(z, own) == pytest.approx(J, abs=1e-6, rel=0.0)
        (trial,) = objective.trials(z[:, None], [objective.whole], runs)
        assert trial[0] == pytest.approx(J, abs=1e-6, rel=0.0)


def both_ways(
    objective: Objective, z: Array, n: int, runs: Sequence[FilterRun]
) -> Iterator[tuple[float, Array, list[FilterRun]]]:
    """Yield a step, the parameters and the runs for one parameter moved by it up, and then down."""
    for step in (
        h := (30.0 if objective.table.parameters[n].of_motion else 3.0) * objective.table.parameters[n].step,
        -h,
    ):
        moved = z.copy()
        moved[n] += step
        yield step, moved, objective.runs(moved, runs)


def names(parameters: Sequence[Parameter]) -> list[str]:
    return [" ".join(filter(None, (p.kind, p.of, p.part))) for p in parameters]


def test_no_error_of_a_derivative_tells_a_scale_of_forces(
    objective: Objective, point: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The motion does not depend on it, and derivatives lose much at a kink. Here, their steps are far too long.

    An assumed thrust would otherwise be told within 1 % by a log that is nearly exact.
    """
    monkeypatch.setattr(parameters, "_MOTION_STEP", 0.03)
    logs = objective.of(DataPart(range(len(objective.logs)), []))
    scales = objective.table.scales_of_forces(point)
    assert len(scales) > 1
    for is_exact, scale in product((True, False), scales):
        for data in logs.data(point, logs.runs(point), exact=is_exact):
            along = np.linalg.norm(data.slopes @ scale[[*data.indices]])
            assert along <= 1e-2 * np.linalg.norm(data.slopes * scale[[*data.indices]])


def test_parameters_in_lanes_have_the_intervals_of_runs_one_by_one(
    objective: Objective, point: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = objective.runs(point)

    def errors() -> Array:
        _, information = total_information(objective, point, objective.data(point, runs))
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))

    def one_by_one(self: Filter, record: Record, sets: Parameters, first: FilterRun, **how: bool) -> list[FilterRun]:
        return [self.run(record, one_set(sets, n), repeated=first, **how) for n in range(sets.count)]

    in_lanes = errors()
    monkeypatch.setattr(Filter, "run_many", one_by_one)
    assert in_lanes == pytest.approx(errors(), rel=1e-5)  # rounding, in differences over steps of 1e-6


def check_gradient(objective: Objective, z: Array) -> None:
    """Compare the gradient of J with differences of J itself. Steps of 1 % in the size of noise give a few per cent.

    A width has kinks, where the ends of windows meet samples.
    """
    runs = objective.runs(z)
    gradient, information = total_information(objective, z, objective.data(z, runs))
    for n, name in enumerate(names(objective.table.parameters)):
        if objective.low[n] == objective.high[n]:
            continue  # of a parameter that is held
        (h, z_up, up), (_, z_down, down) = both_ways(objective, z, n, runs)
        expected = (objective.value(z_up, up) - objective.value(z_down, down)) / (2.0 * h)
        near = 0.03 if objective.table.parameters[n].of_motion else 0.2 if "width" in name else 0.06
        assert abs(gradient[n] - expected) < near * abs(expected) + 0.01 * np.sqrt(information[n, n]), name
        silent = ("dead band astern rear", "advance astern rear")
        assert abs(expected) > 1e-6 or name in silent, "a ratio says nothing where there is neither dead band nor loss"


def test_the_gradient_is_that_of_j(objective: Objective, point: Array) -> None:
    check_gradient(objective, point)


def test_the_gradient_is_that_of_j_where_the_model_is_wrong(tmp_path: Path) -> None:
    """The thrust of the log is 3 times that of the file, and the slow change of thrust makes up for it.

    The log has a voltage and a distance over ground. With frozen gains, the gradient has other signs.
    """
    path = folder_of(tmp_path / "tests", KNOWN, {"thrust_rear.csv": pulled(43.0, 2.7)})
    stronger = VIDEORAY.with_(**{name: 3.0 * VIDEORAY[name] for name in ("a_t_rear", "b_t_rear")})
    log = write_log(path, "0", run(stronger, SURGE, PLAN, 5.0).noisy(np.random.default_rng(0), "distance"))
    add_voltage(log)
    known, logs, rows = begin(load_tests(path))
    objective = Objective.of_known(known, logs, rows)
    kinds = [p.kind for p in objective.table.parameters]
    assert {"voltage", "current", "slow gain", "slow velocity"} <= {*kinds}
    z = objective.mean.copy()
    z[kinds.index("slow gain")] = np.log(0.2)
    z[kinds.index("slow force")] = np.log(0.02)
    z[kinds.index("sensor lag")] = 0.1
    check_gradient(objective, z)


def test_the_number_of_threads_changes_no_bit(
    objective: Objective, point: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    def found(cores: int) -> bytes:
        monkeypatch.setattr("rov_fmu.identify.likelihood.objective.usable_cores", lambda: cores)
        best = minimise(objective, point, most=1)
        arrays = [best.z, best.information, *(one.gains for one in best.runs), *(one.slopes for one in best.data)]
        return b"".join(array.tobytes() for array in arrays)

    assert found(4) == found(1)


def test_j_is_the_sum_of_its_parts(objective: Objective, point: Array) -> None:
    """The prior, each sample of each log, and each row of a table, by the formula."""
    runs, parameters = objective.runs(point), objective.table.parameters
    free = ((z, p) for z, p in zip(point.tolist(), parameters, strict=True) if not p.is_fixed)
    expected = sum(((z - p.mean) / p.deviation) ** 2 for z, p in free)
    for off, S in [*((one.innovations, one.variances) for one in runs), objective.row_values(point)]:
        u = np.abs(off) / np.sqrt(S)
        expected += float(
            np.sum(np.log(S) + np.where(u > 3.0, 9.0 + 9.0 * np.log(np.maximum(u, 3.0) ** 2 / 9.0), u * u))
        )
    assert objective.value(point, runs) == pytest.approx(expected, rel=1e-12)


@pytest.mark.weekly
def test_fits_to_parts_of_the_data_end_where_a_full_search_does(objective: Objective, point: Array) -> None:
    """Without each log and without each row, from the minimum for all data."""
    best = minimise(objective, point)
    logs, rows = objective.whole.logs, objective.whole.rows
    parts = [DataPart([m for m in logs if m != n], rows) for n in logs] + [
        DataPart(logs, [m for m in rows if m != rows[0]])
    ]
    of_motion = np.array([p.of_motion for p in objective.table.parameters])
    for part, found in zip(parts, refits(objective, best, parts), strict=True):
        own = objective.of(part)
        assert found.value <= own.value(best.z, [best.runs[n] for n in part.logs])
        assert (found.z == best.z)[~of_motion].all(), "the noise stays"
        (again,) = refits(own, minimise(own, found.z), [own.whole])
        errors = np.sqrt(np.diag(np.linalg.inv(again.information / 2.0)))
        assert (np.abs(found.z - again.z) < 1.5 * errors)[of_motion].all()


def test_a_search_ends_where_the_motion_diverges_and_begins_elsewhere_if_it_does_there(
    objective: Objective, point: Array
) -> None:
    """With the noise of a first fit, and then with all values of a careful start."""
    z, first, careful = np.clip(point, objective.low, objective.high), start_of(objective), start_of(objective, 2)
    louder = np.where([p.of_motion for p in objective.table.parameters], z, np.maximum(z, first))
    for failures, start in enumerate((z, louder, careful)):
        step, data = (
            minimise(objective, start, most=1, last=False),
            objective.data(start, objective.runs(start), exact=False),
        )
        with patch.object(Objective, "data", side_effect=[*[DivergedError] * failures, data, DivergedError]):
            assert minimise(objective, z, last=False).z == pytest.approx(step.z)
    with patch.object(Objective, "data", side_effect=DivergedError), pytest.raises(DivergedError):
        minimise(objective, z)


def test_sets_of_parameters_have_the_rows_of_each_of_them(objective: Objective, point: Array) -> None:
    """One call for all sets gives the same as a call for each, and the same J."""
    moved = (
        point[:, None] + 1e-3 * np.random.default_rng(2).standard_normal((len(point), 5)) * objective.deviation[:, None]
    )
    moved = np.clip(moved.T, objective.low, objective.high).T
    off, S = objective.row_values(moved)
    runs = objective.runs(point)
    trials = objective.trials(moved, [objective.whole] * 5, runs)
    for n in range(5):
        one_off, one_S = objective.row_values(moved[:, n])
        assert off[:, n] == pytest.approx(one_off, rel=1e-12, abs=1e-14)  # of measurements of metres
        assert S[:, n] == pytest.approx(one_S, rel=1e-12)
        alone = objective.value(moved[:, n], objective.runs(moved[:, n], runs))
        assert trials[n][0] == pytest.approx(alone, rel=1e-9)
