"""The vehicle file is a fit: J of its numbers, and intervals whatever the size of an effect, wider with less data."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from rov_fmu.equation.catalogue import HEAVE, YAW
from rov_fmu.identify import assess
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.given import Tests as Given
from rov_fmu.identify.identified_vehicle import identified_vehicle, vehicle_of_file
from rov_fmu.identify.likelihood.fit import Fit, fit_all
from rov_fmu.identify.likelihood.solve import ENOUGH, minimise
from rov_fmu.identify.result import KEPT
from rov_fmu.vehicle.vehicle import Vehicle
from tests.folders import folder_of
from tests.frozen.known import HERE
from tests.identify.conftest import FORCES, KNOWN, TRUTH
from tests.often import spread
from tests.recordings import run, with_more, write_log

PLAN = ((0.0, 2.0), (0.3, 10.0), (-0.3, 10.0), (0.5, 8.0), (-0.5, 8.0))


def drawn(folder: Path, load: float, noise: float, seed: int) -> tuple[Fit, Vehicle, Vehicle]:
    """Return the fit to a log of a vehicle with a load (N), its file, and the true vehicle."""
    truth = with_more(TRUTH, F_0_w=load)
    path = folder_of(folder, KNOWN, FORCES)
    write_log(path, "a", run(truth, HEAVE, PLAN, 10.0).noisy(np.random.default_rng(seed), noise=noise))
    tests = load_tests(path)
    fit = fit_all(*begin(tests))
    return fit, vehicle_of_file(fit, identified_vehicle(tests, fit)[0], path), truth


def least_without_evidence(fit: Fit) -> float:
    """Return J of what is told without the effects that are left out of the file whatever the rise."""
    table, absent = fit.objective.table, fit.file.posterior.absent
    keys = {
        p.key for n, p in enumerate(fit.file.posterior.table.parameters) if n in absent and p.of_kind.needs_evidence
    }
    indices = [n for n, p in enumerate(table.parameters) if p.key in keys]
    assert all(fit.posterior.evidence(n) < KEPT for n in indices)
    return minimise(fit.objective.without(indices), fit.best.z).value if indices else fit.best.value


@pytest.mark.weekly
def test_the_file_is_a_minimum_without_the_weakest_effects(tmp_path: Path) -> None:
    """J rises by 2 at most, to a tenth. `vehicle_of_file` compares J of the numbers of the file with that of the fit,
    and a fit from elsewhere is not better."""
    fit, vehicle, _ = drawn(tmp_path, 0.01, 0.02, 1)
    file, parameters = fit.file, fit.file.posterior.table.parameters
    assert file.posterior.absent
    assert file.minimum.value - least_without_evidence(fit) <= 2.1
    for n in file.posterior.absent:
        assert file.minimum.z[n] == parameters[n].null, parameters[n]
    assert minimise(file.objective, fit.best.z).value > file.minimum.value - 0.5
    with pytest.raises(RuntimeError, match="differs by"):
        vehicle_of_file(fit, vehicle.with_(a_d_w=1.1 * vehicle["a_d_w"]), tmp_path)


@pytest.mark.parametrize("name", spread(("pool", "tadpole", "harbour", "otter"), ["tadpole"], ["pool"]))
def test_what_is_told_is_the_vehicle_of_the_file_with_its_weak_effects(name: str) -> None:
    tests = load_tests(HERE / "tank_tests" / name)
    fit = fit_all(*begin(tests))
    assert fit.file.minimum.value - least_without_evidence(fit) <= 2.0 + 2.0 * ENOUGH, "both end so near to a minimum"


@pytest.mark.parametrize(
    ("load", "seeds"),
    [
        pytest.param(0.02, 3, marks=pytest.mark.long),
        *(pytest.param(load, 5, marks=pytest.mark.weekly) for load in (0.0, 0.01, 0.05, 0.1)),
    ],
)
def test_intervals_contain_the_truth_whatever_the_size_of_a_load(load: float, seeds: int, tmp_path: Path) -> None:
    """A load of 0 to 2 % of the thrust, which is in the file or not."""
    covered = []
    for seed in range(seeds):
        fit, vehicle, truth = drawn(tmp_path / str(seed), load, 0.02, seed)
        for answer in assess.answers(fit.posteriors, HEAVE, vehicle, (0.5, 0.5)):
            if abs(answer.command) < 1.0:
                V, Tau = truth.response(HEAVE, answer.command)
                for number, (_, (low, high)) in ((V, answer.steady), (Tau, answer.rise)):
                    covered.append(low <= number <= high)
    assert sum(covered) >= binom.ppf(0.001, len(covered), 0.9), covered


@pytest.mark.weekly
def test_less_data_of_an_axis_widen_its_answers_and_those_of_no_other_axis(
    fit: Fit, short: Given, tmp_path: Path
) -> None:
    """Of heave, half of the log is left."""
    folder = Path(shutil.copytree(short.folder.path, tmp_path / "half"))
    log = folder / "log_heave_a.csv"
    log.write_text("\n".join(log.read_text(encoding="utf-8").splitlines()[:110]), encoding="utf-8")
    half = load_tests(folder)
    widths = []
    for tests, of_tests in ((short, fit), (half, fit_all(*begin(half)))):
        vehicle = identified_vehicle(tests, of_tests)[0]
        answers = (assess.answers(of_tests.posteriors, axis, vehicle, (0.3, 0.3)) for axis in (HEAVE, YAW))
        ends = [[answer.steady[1] for answer in of if answer.command in (-0.3, 0.3, 0.5)] for of in answers]
        widths.append(np.diff(ends)[..., 0])
    ratios = widths[1] / widths[0]
    assert ratios[0].min() > 1.2
    assert ratios[1] == pytest.approx(1.0, abs=0.1)
