"""The FMU in pure Python is valid and gives the same results as the native one."""

import json
import os
import random
import shutil
import sysconfig
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import inf, nan
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from rov_fmu.cli import main
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.python.step import Change
from rov_fmu.fmu.content import python_content
from rov_fmu.fmu.python_flavour import python_sources
from rov_fmu.fmu.slave import Rov
from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import python
from tests.conftest import Made, unzipped, without_page
from tests.fmi import OK
from tests.fmu.calls.test_arguments import STOPS
from tests.vehicles import HEAVY, SIX, THRUST_EFFECTS, a_vehicle, passed, pulsed, random_inputs
from verification.references import fmpy_slave
from verification.references.c_programs import Ended, compile_c, run_program
from verification.references.fmpy_slave import keep_loaded


@pytest.fixture(scope="session")
def python_fmu(made_once: Made) -> Path:
    def fill(folder: Path) -> None:
        path = folder / "videoray-python.fmu"
        with without_page():
            assert main(["build", "--backend", "pythonfmu", "-o", str(path)]) == 0
        fmpy.extract(str(path), unzipdir=str(path.with_suffix("")))

    return made_once("python flavour", fill) / "videoray-python.fmu"


@pytest.fixture(scope="session")
def python_dir(python_fmu: Path) -> Path:
    keep_loaded(python_fmu.with_suffix(""))
    return python_fmu.with_suffix("")


def _instance(folder: Path) -> FMU2Slave:
    slave: FMU2Slave = fmpy_slave.Slave(folder).fmu
    slave.setupExperiment(startTime=0.0)
    return slave


def test_it_is_valid_and_says_what_it_can_do(python_fmu: Path, vehicle: Vehicle) -> None:
    assert validate_fmu(str(python_fmu)) == []
    description = fmpy.read_model_description(str(python_fmu))
    assert [v.name for v in description.modelVariables] == [v.name for v in variables(vehicle)]
    assert description.modelExchange is None
    can = description.coSimulation
    assert (can.canGetAndSetFMUstate, can.canSerializeFMUstate, can.needsExecutionTool) == (True, True, True)
    assert not can.providesDirectionalDerivative
    assert can.maxOutputDerivativeOrder == 0


_PULSES = replace(pulsed(load_vehicle(THRUST_EFFECTS), (1100.0, 1480.0, 1900.0)), identifier="delayed_pulses")

Both = tuple[Vehicle, FMU2Slave, FMU2Slave]


@pytest.fixture(
    params=[
        "videoray",
        pytest.param("six axes", marks=pytest.mark.long),
        pytest.param("pulses", marks=pytest.mark.long),
    ]
)
def both(request: pytest.FixtureRequest, made_once: Made, vehicle: Vehicle, tmp_path: Path) -> Iterator[Both]:
    """Return a vehicle, and an instance of each flavour. The last vehicle has pulse widths and a dead time."""
    if request.param == "videoray":
        folders = [request.getfixturevalue(name) for name in ("python_dir", "videoray_dir")]
    else:
        vehicle = a_vehicle(SIX) if request.param == "six axes" else _PULSES
        native = made_once("six" if vehicle.layout.has_attitude else "pulses", partial(unzipped, vehicle))
        for name, data in python_content(vehicle).files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_bytes(data)
        keep_loaded(tmp_path)
        folders = [tmp_path, native]
    slaves = [_instance(folder) for folder in folders]
    yield vehicle, slaves[0], slaves[1]
    for slave in slaves:
        slave.terminate()
        slave.freeInstance()


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 4))])
def test_both_flavours_move_the_same_way(both: Both, seed: int) -> None:
    """With other coefficients, ballast and tuning that change, and states that are restored."""
    vehicle, *slaves = both
    rng, layout = random.Random(seed), vehicle.layout
    declared = {v.name: v for v in variables(vehicle)}
    longest, error = (1.0, 1e-12) if vehicle.identifier == "videoray" else (-0.8, 1e-11)
    compared = [v.value_reference for v in declared.values() if v.causality != "parameter"]
    usual = {v.name: v.start for v in declared.values() if v.causality == "parameter" and v.start}

    def put(values: Mapping[str, float]) -> None:
        for slave in slaves:
            slave.setReal([declared[name].value_reference for name in values], [*values.values()])

    def compare() -> None:
        python, native = (slave.getReal(compared) for slave in slaves)
        assert python == pytest.approx(native, rel=error, abs=error)

    put({name: x * rng.uniform(0.8, 1.2) for name, x in usual.items()})
    put(dict(zip(layout.initial, (0.5, -0.8, 7.0), strict=False)))
    for slave in slaves:
        slave.enterInitializationMode()
    compare()
    for slave in slaves:
        slave.exitInitializationMode()
    t = 0.0
    saved = [slave.getFMUState() for slave in slaves]
    for _ in range(60):
        inputs = random_inputs(rng, vehicle)
        if layout.pulse:
            inputs |= {name: rng.choice((0.0, 1480.0, rng.uniform(1000.0, 2000.0))) for name in layout.commands}
        put(inputs)
        tuned = rng.choice([name for name in usual if declared[name].variability == "tunable"])
        put({tuned: usual[tuned] * rng.uniform(0.8, 1.2)})
        h = 10.0 ** rng.uniform(-4.0, longest)
        for slave in slaves:
            slave.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        t += h
        compare()
        if rng.random() < 0.1:
            saved = [slave.getFMUState() for slave in slaves]
        if rng.random() < 0.1:
            for slave, state in zip(slaves, saved, strict=True):
                as_bytes = slave.serializeFMUstate(state)
                slave.setFMUState(slave.deSerializeFMUstate(as_bytes) if seed % 2 else state)
            compare()


class Slave:
    """The slave in this process, without PythonFMU's library."""

    def __init__(self, vehicle: Vehicle, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        for name, text in python_sources(vehicle, variables(vehicle)).items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        monkeypatch.syspath_prepend(folder)
        self.rov = Rov(instance_name="rov", resources=str(folder))
        self.places = {v.name: v.value_reference for v in variables(vehicle)}

    def logged(self) -> list[str]:
        """Return what was logged since the last time."""
        messages = [message.msg for message in self.rov.log_queue]
        self.rov.log_queue.clear()
        return messages

    def put(self, **values: float) -> list[str]:
        """Set variables, and return what is logged."""
        self.rov.set_real([self.places[name] for name in values], list(values.values()))
        return self.logged()

    def get(self, *names: str) -> list[float]:
        values: list[float] = self.rov.get_real([self.places[name] for name in names])
        return values

    def step(self, t: float, h: float) -> tuple[bool, list[str]]:
        """Take a step, and return whether it was taken, and what is logged."""
        return self.rov.do_step(t, h), self.logged()


@pytest.fixture
def slave(vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Slave:
    """The slave of the VideoRay."""
    return Slave(vehicle, tmp_path, monkeypatch)


def test_inputs_that_saturate_and_steps_that_cannot_be_taken_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slave = Slave(_PULSES, tmp_path, monkeypatch)
    slave.rov.setup_experiment(1.0, 3.0, None)
    slave.rov.exit_initialization_mode()
    assert slave.put(u_l=1100.0, u_r=1900.0, voltage=12.0) == slave.put(voltage=16.0, X_ext=1e9) == []
    assert slave.put(u_l=0.0) == ["u_l = 0 means that there is no signal: it acts as neutral; logged once."]
    assert slave.put(u_l=1099.0, u_r=1901.0, u_rudder=2500.0) == [
        "u_l = 1099.0 saturates at 1100; logged once.",
        "u_r = 1901.0 saturates at 1900; logged once.",
        "u_rudder = 2500.0 saturates at 1900; logged once.",
    ]
    assert slave.put(voltage=11.0) == ["voltage = 11.0 saturates at 12 for the thrust curve main; logged once."]
    assert slave.put(u_l=0.0, u_r=2500.0, voltage=17.0, X_ext=0.0) == []
    for h, words in ((0.0, "0.0 at t = 1.0"), (-0.1, "-0.1 at t = 1.0"), (inf, "inf at t = 1.0")):
        assert slave.step(1.0, h) == (False, [f"step size {words} is not a step forward."])
    assert slave.step(1.0, 2.1) == (False, ["a step of 2.1 s passes the stop time 3.0."])
    before = slave.rov._get_fmu_state()
    assert slave.put(u=1e300) == ["u must not be set after the initialization; it was not."]
    assert slave.step(1.0, 0.5) == (True, [])
    assert slave.step(1.5, 1.0) == (True, [])
    assert slave.step(2.6, 0.1) == (True, ["the step from t = 2.6 does not begin at t = 2.5; logged once."])
    after = slave.get("u", "r", "delayed_u_r", "F_bow")
    slave.rov._set_fmu_state(json.loads(json.dumps(before)))
    assert slave.get("u", "delayed_u_r") == [0.0, 1480.0], "the commands that were set have not arrived"
    for t, h in ((1.0, 0.5), (1.5, 1.0), (2.6, 0.1)):
        assert slave.step(t, h) == (True, [])
    assert slave.get("u", "r", "delayed_u_r", "F_bow") == after
    assert after[2] == 1900.0, "it saturates"
    slave.rov.memory.waiting = [Change(0.05, dict.fromkeys(slave.rov.memory.names, 1100.0))] * 1024
    many = "more than 1024 changes of commands wait for the dead time; change them less often."
    assert slave.step(slave.rov.time, 0.1) == (False, [many])
    slave.rov._set_fmu_state(slave.rov._get_fmu_state() | {"waiting": []})
    overflow = ["the motion overflows within 0.1 s, or takes too many substeps: it is too fast or long."]
    slave.put(X_ext=1.7e308)
    assert slave.step(slave.rov.time, 0.1) == (False, overflow)
    assert slave.get("u", "r", "delayed_u_r", "F_bow") == after


def test_the_current_before_is_part_of_the_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current of the first step is no change. A current that passes leaves the way over ground."""
    slave = Slave(replace(a_vehicle(passed(HEAVY)), identifier="passed"), tmp_path, monkeypatch)
    slave.put(V_N=0.7, u=0.1)
    slave.rov.exit_initialization_mode()
    slave.put(V_N=0.4)
    slave.rov._set_fmu_state(json.loads(json.dumps(slave.rov._get_fmu_state())))
    slave.put(V_N=0.2)
    assert slave.get("V_N_before") == [0.2]
    assert slave.step(0.0, 1e-9)[0]
    assert slave.get("u", "V_N_before") == pytest.approx([0.1, 0.2], abs=1e-8)
    before = slave.rov._get_fmu_state()
    for _ in range(2):
        assert slave.put(V_N=0.5) == []
        assert slave.step(slave.rov.time, 1e-9)[0]
        assert slave.get("u", "V_N_before") == pytest.approx([-0.2, 0.5], abs=1e-8)
        slave.rov._set_fmu_state(json.loads(json.dumps(before)))


def test_what_is_set_again_is_harmless_and_the_angles_replace_the_quaternion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slave = Slave(a_vehicle(SIX), tmp_path, monkeypatch)
    put, get = slave.put, slave.get
    assert put(psi_0=0.5) == []
    expected = get(*QUATERNION)
    (warning,) = put(eta=0.0, epsilon_1=0.0, epsilon_2=0.0, epsilon_3=0.0)
    assert "eta = 0.0 is replaced by" in warning
    assert get(*QUATERNION) == expected
    slave.rov.exit_initialization_mode()
    (warning,) = put(psi_0=0.5, m_rov=SIX["m_rov"])  # GEMSEO-FMU sets parameters again
    assert "psi_0 must not be set after the initialization, but it has this value already" in warning
    assert put(N_ext=1.0, psi_0=0.6) == ["psi_0 must not be set after the initialization; it was not."]
    assert put(eta=1.0) == ["eta must not be set after the initialization; it was not."]
    assert get("N_ext", "psi_0", *QUATERNION) == [0.0, 0.5, *expected]
    before = get("m_rov", "z_G", "der(q)")
    (refused,) = put(m_rov=2.0 * SIX["m_rov"], z_G=50.0)
    assert refused.startswith("the mass matrix of these parameters is not positive definite")
    assert get("m_rov", "z_G", "der(q)") == before
    assert put(m_rov=1.2 * SIX["m_rov"]) == []


@pytest.mark.parametrize(("start", "stop", "t", "h", "status"), STOPS)
def test_it_ends_at_the_stop_time_of_the_native_one(
    slave: Slave, start: float, stop: float | None, t: float, h: float, status: int
) -> None:
    slave.rov.setup_experiment(start, stop, None)
    slave.rov.exit_initialization_mode()
    assert slave.step(t, h)[0] == (status == OK)


def test_what_the_native_one_refuses_is_refused_without_an_exception(slave: Slave, vehicle: Vehicle) -> None:
    """PythonFMU 0.7 releases its objects twice after an exception, so that a later instance crashes the process."""
    calculated = [v.name for v in variables(vehicle) if v.initial == "calculated"]
    assert len(calculated) > 3
    for name in calculated:
        assert slave.put(**{name: 1.0}) == [f"{name} is calculated and must not be set; it was not."]
    for name, value in {"u_l": nan, "Z_ext": inf, "m_rov": -1.0, "R": 101.0, "beta_r": nan}.items():
        (before,) = slave.get(name)
        assert slave.put(**{"u_r": 0.5, name: value}) == [f"{name} = {value!r} is refused; it stays {before!r}."]
        assert slave.get("u_r", name) == [0.0, before]


@pytest.fixture
def importer(tmp_path: Path) -> Path:
    """Return an importer that is not a Python process."""
    if fmpy.platform != "linux64":
        pytest.skip(
            "PythonFMU has a binary for Linux on x86-64; that of Windows is not preloaded but finds python3.dll"
        )
    return compile_c(Path(__file__).with_name("c_importer.c"), tmp_path / "c_importer", tmp_path, "-ldl")


def _imported(importer: Path, folder: Path, **environment: str) -> Ended:
    description = fmpy.read_model_description(str(folder))
    library = folder / "binaries" / "linux64" / "videoray.so"
    resources = (folder / "resources").as_uri()
    return run_program(importer, library, description.guid, resources, env=os.environ | environment)


FLY = """
import sys, fmpy
commands = {"u_l": 0.3, "u_r": 0.3}
for folder in sys.argv[1:]:
    result = fmpy.simulate_fmu(folder, start_values=commands, stop_time=1.0, output_interval=1.0, validate=False)
    print(f"{result['u'][-1]:.6f}")
"""


@pytest.mark.long
def test_every_path_of_the_resources_is_found(tmp_path: Path, python_dir: Path) -> None:
    """A process of its own flies all of them, because PythonFMU's library crashes where it finds nothing."""
    folders = [tmp_path / name for name in ("plain", "u ml\u00e4ut", "plus+x", "hash#x", "pct%20x", "quo'te", "p%te")]
    for folder in folders:
        shutil.copytree(python_dir, folder)
    first, *others = python("-c", FLY, *map(str, folders)).split()
    assert float(first) > 0.1
    assert others == [first] * 6


def test_an_importer_that_is_not_a_python_process_preloads_libpython(
    importer: Path, python_dir: Path, videoray_dir: Path
) -> None:
    """docs/platforms.md and the FMU's description and page tell users to do so."""
    alone = _imported(importer, python_dir)
    assert (alone.code, alone.lines) == (1, [])
    assert "undefined symbol: _Py_NoneStruct" in alone.errors
    libpython = Path(sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME"))
    if not sysconfig.get_config_var("Py_ENABLE_SHARED") or not libpython.exists():
        pytest.skip(f"this Python has no shared library: {libpython}")
    preloaded, native = _imported(importer, python_dir, LD_PRELOAD=str(libpython)), _imported(importer, videoray_dir)
    assert preloaded.code == native.code == 0, preloaded.errors + native.errors
    ((u,),), ((expected,),) = preloaded.lines, native.lines
    assert float(u) == pytest.approx(float(expected), rel=1e-12)
