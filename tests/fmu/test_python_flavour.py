"""The FMU in pure Python is valid and gives the same results as the native one."""

import os
import random
import shutil
import subprocess
import sys
import sysconfig
from contextlib import nullcontext
from itertools import product
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from rov_fmu.cli import main
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.fmu.archive import python_content
from rov_fmu.fmu.python_flavour import python_sources
from rov_fmu.fmu.slave import Rov
from rov_fmu.fmu.variables import Variable, variables
from rov_fmu.vehicle.vehicle import Vehicle
from tests.commands import ROOT
from tests.conftest import Made, without_page
from tests.fmi import WARNING, Message
from tests.fmi2 import recording_callbacks
from tests.vehicles import SIX, a_vehicle
from verification.references.c_programs import Ended, compile_c, run_program
from verification.references.fmpy_slave import fmpy_slave, keep_loaded


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
    slave = fmpy_slave(folder)
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


def test_its_modules_import_nothing_of_the_package(vehicle: Vehicle) -> None:
    for name, text in python_sources(vehicle, variables(vehicle)).items():
        lines = [line.split() for line in text.splitlines()]
        imported = [words[1] for words in lines if words[:1] in (["from"], ["import"]) and len(words) > 1]
        assert not [module for module in imported if module.startswith("rov_fmu")], name


def _by_kind(declared: tuple[Variable, ...], **wanted: str) -> list[Variable]:
    return [v for v in declared if all(getattr(v, key) == value for key, value in wanted.items())]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 6))])
def test_both_flavours_move_the_same_way(python_dir: Path, videoray_dir: Path, vehicle: Vehicle, seed: int) -> None:
    random_ = random.Random(seed)
    declared = variables(vehicle)
    both = [_instance(python_dir), _instance(videoray_dir)]
    outputs = [v.value_reference for v in declared if v.causality != "parameter"]
    parameters = _by_kind(declared, causality="parameter")

    def set_both(chosen: list[Variable], values: list[float]) -> None:
        for slave in both:
            slave.setReal([v.value_reference for v in chosen], values)

    def compare() -> None:
        python, native = (slave.getReal(outputs) for slave in both)
        assert python == pytest.approx(native, rel=1e-12, abs=1e-12)

    set_both(parameters, [v.start * random_.uniform(0.5, 1.5) for v in parameters if v.start is not None])
    for slave in both:
        slave.enterInitializationMode()
    compare()
    for slave in both:
        slave.exitInitializationMode()
    t = 0.0
    saved = [slave.getFMUState() for slave in both]
    for _ in range(60):
        inputs = _by_kind(declared, causality="input")
        set_both(inputs, [random_.choice((0.0, random_.uniform(-1.2, 1.2))) for _ in inputs])
        tuning = random_.choice(_by_kind(declared, variability="tunable"))
        set_both([tuning], [random_.uniform(0.1, 2.0)])
        h = 10.0 ** random_.uniform(-4.0, 1.0)
        for slave in both:
            slave.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        t += h
        compare()
        if random_.random() < 0.1:
            saved = [slave.getFMUState() for slave in both]
        if random_.random() < 0.1:
            for slave, state in zip(both, saved, strict=True):
                as_bytes = slave.serializeFMUstate(state)
                slave.setFMUState(slave.deSerializeFMUstate(as_bytes) if seed % 2 else state)
            compare()
    for slave in both:
        slave.terminate()
        slave.freeInstance()


@pytest.mark.long
def test_both_flavours_tilt_the_same_way(tmp_path: Path, six_dir: Path) -> None:
    """They begin at the given attitude, and a restored state continues with its heading."""
    for name, data in python_content(a_vehicle(SIX)).files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(data)
    keep_loaded(tmp_path)
    rng, declared = random.Random(7), variables(SIX)
    both = [_instance(tmp_path), _instance(six_dir)]
    place = {v.name: v.value_reference for v in declared}
    outputs = [v.value_reference for v in declared if v.causality != "parameter"]

    def compare() -> None:
        python, native = (slave.getReal(outputs) for slave in both)
        assert python == pytest.approx(native, rel=1e-11, abs=1e-11)

    for slave in both:
        slave.setReal([place[name] for name in SIX.layout.initial], [0.5, -0.8, 7.0])
        slave.enterInitializationMode()
    compare()
    assert both[0].getReal([place["psi"]]) == pytest.approx([7.0])
    for slave in both:
        slave.exitInitializationMode()
    saved = [slave.getFMUState() for slave in both]
    for n in range(20):
        values = [rng.uniform(-1.2, 1.2) for _ in SIX.layout.inputs]
        for slave in both:
            slave.setReal([place[name] for name in SIX.layout.inputs], values)
            slave.doStep(currentCommunicationPoint=0.1 * n, communicationStepSize=0.1)
        compare()
    for slave, state in zip(both, saved, strict=True):
        slave.setFMUState(state)
    compare()
    assert both[0].getReal([place["psi"]]) == pytest.approx([7.0])
    before = both[0].getReal([place["eta"]])
    both[0].setReal([place["eta"]], [1.0])
    assert both[0].getReal([place["eta"]]) == before != [1.0]
    for slave in both:
        slave.terminate()
        slave.freeInstance()


def test_what_is_set_again_is_harmless_and_the_angles_replace_the_quaternion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in python_sources(a_vehicle(SIX), variables(SIX)).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    slave = Rov(instance_name="rov", resources=str(tmp_path))
    place = {v.name: v.value_reference for v in variables(SIX)}

    def put(**values: float) -> list[str]:
        """Set variables, and return what is logged."""
        slave.log_queue.clear()
        slave.set_real([place[name] for name in values], list(values.values()))
        return [message.msg for message in slave.log_queue]

    def get(*names: str) -> list[float]:
        return slave.get_real([place[name] for name in names])

    assert put(psi_0=0.5) == []
    expected = get(*QUATERNION)
    (warning,) = put(eta=0.0, epsilon_1=0.0, epsilon_2=0.0, epsilon_3=0.0)
    assert "eta = 0.0 is replaced by" in warning
    assert get(*QUATERNION) == expected
    slave.exit_initialization_mode()
    slave.set_real([place["N_ext"]], [20.0])
    assert slave.do_step(0.0, 1.0)
    turned = get(*QUATERNION)
    (warning,) = put(psi_0=0.5, m_rov=SIX["m_rov"])  # GEMSEO-FMU sets parameters again
    assert "psi_0 must not be set after the initialization, but it has this value already" in warning
    assert get(*QUATERNION) == turned != expected
    (error,) = put(N_ext=0.0, psi_0=0.6)
    assert error == "psi_0 must not be set after the initialization; it was not."
    assert put(eta=1.0) == ["eta must not be set after the initialization; it was not."]
    assert get("N_ext", "psi_0", *QUATERNION) == [20.0, 0.5, *turned]
    assert put(alpha_r=0.5, N_ext=1.0) == []
    before = get("m_rov", "z_G", "der(q)")
    (refused,) = put(m_rov=2.0 * SIX["m_rov"], z_G=50.0)
    assert refused.startswith("the mass matrix of these parameters is not positive definite")
    assert get("m_rov", "z_G", "der(q)") == before
    assert put(m_rov=1.2 * SIX["m_rov"]) == []


# start time, stop time, t and h of a step, and True if the step is accepted
STOPS = [
    (0.0, 1.0, 0.9, 0.1 + 1.0e-9, True),
    (0.0, 1.0, 0.9, 0.1 + 1.2e-9, False),
    (0.0, 1e-6, 9e-7, 1.0e-7 + 0.9e-15, True),
    (0.0, 1e-6, 9e-7, 1.0e-7 + 1.2e-15, False),
    (0.0, 1e6, 1e6, 1e-2, False),  # within 1e-9 of the stop time, but a whole step
    (0.0, 1e6, 1e6 - 0.9e-3, 1e-3, True),
    (0.0, 1e6, 1e6 - 0.4e-3, 1e-3, False),
    (0.0, 1e6, 1e6 - 0.6e-3, 1e-3, True),
    (-2.0, -1.0, -1.1, 0.1 + 1.0e-9, True),
    (-2.0, -1.0, -1.1, 0.1 + 1.2e-9, False),
    (0.0, None, 1e6, 1e3, True),
]


def test_both_flavours_end_at_the_same_stop_time(python_dir: Path, videoray_dir: Path) -> None:
    for (start, stop, t, h, done), folder in product(STOPS, (python_dir, videoray_dir)):
        slave = fmpy_slave(folder)
        slave.setupExperiment(startTime=start, stopTime=stop)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        with nullcontext() if done else pytest.raises(FMICallException):
            slave.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        slave.freeInstance()


def test_both_flavours_warn_once_about_saturation_and_about_a_jump_in_time(
    python_dir: Path, videoray_dir: Path
) -> None:
    for folder in (python_dir, videoray_dir):
        log: list[Message] = []
        slave = fmpy_slave(folder, recording_callbacks(log))
        slave.setupExperiment(startTime=1.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        saved, warned = slave.getFMUState(), []
        for t in (1.0, 1.1, 1.0, 1.1 + 1e-11, 1.5, 9.0):
            if t == 1.0:
                slave.setFMUState(saved)  # a step from a restored state is no jump
            slave.setReal([0], [1.5])
            slave.doStep(currentCommunicationPoint=t, communicationStepSize=0.1)
            warned.append([m.text for m in log if m.status == WARNING])
        assert [len(texts) for texts in warned] == [1, 1, 1, 1, 2, 2]
        assert "u_l = 1.5 saturates at 1; logged once." in warned[0][0]
        assert "step from t = 1.5 does not begin at t = 1.2" in warned[-1][1]
        slave.freeInstance()


def test_values_that_the_native_one_refuses_are_refused(python_dir: Path, vehicle: Vehicle) -> None:
    by_name = {v.name: v for v in variables(vehicle)}
    slave = _instance(python_dir)
    slave.enterInitializationMode()
    for name, value in (("u_l", float("nan")), ("Z_ext", float("inf")), ("m_rov", -1.0), ("beta_r", float("nan"))):
        reference = [by_name[name].value_reference]
        slave.setReal(reference, [value])
        assert slave.getReal(reference) == [by_name[name].start]
    slave.freeInstance()


def test_a_refused_value_leaves_the_process_intact(python_dir: Path, vehicle: Vehicle) -> None:
    """PythonFMU 0.7 releases its objects twice after an exception, so that a later instance crashes the process."""
    calculated = _by_kind(variables(vehicle), initial="calculated")
    for v in calculated:
        log: list[Message] = []
        slave = fmpy_slave(python_dir, recording_callbacks(log))
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        before = slave.getReal([v.value_reference])
        slave.setReal([v.value_reference], [1.0])
        assert slave.getReal([v.value_reference]) == before
        assert [m.text for m in log] == [f"{v.name} is calculated and must not be set; it was not."]
        slave.freeInstance()
    assert len(calculated) > 3


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
    done = subprocess.run([sys.executable, "-c", FLY, *map(str, folders)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    first, *others = done.stdout.split()
    assert float(first) > 0.1
    assert others == [first] * 6


@pytest.mark.long
def test_resources_that_are_missing_are_named_and_no_crash(tmp_path: Path, python_dir: Path) -> None:
    shutil.copytree(python_dir, tmp_path / "fmu")
    (tmp_path / "fmu" / "resources").rename(tmp_path / "moved")
    program = """
import sys
from pathlib import Path
from tests.fmi2 import recording_callbacks
from verification.references.fmpy_slave import fmpy_slave
log = []
try:
    fmpy_slave(Path(sys.argv[1]), recording_callbacks(log))
except Exception:
    print(log[0].text)
"""
    command = [sys.executable, "-c", program, str(tmp_path / "fmu")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "fmi2Instantiate: the resource folder " in done.stdout


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
