"""What a vehicle remembers is in MuJoCo's data, and MuJoCo's errors are exceptions."""

import gc
import re
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import copy, deepcopy
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import rov_fmu
from rov_fmu.bridges.mujoco import mujoco_files, mujoco_texts
from rov_fmu.bridges.mujoco.source import water_sources
from rov_fmu.tank.arrays import Array
from tests.bridges.test_mujoco import loaded, mujoco, scene
from tests.commands import BARE


def world(package: ModuleType) -> Any:
    """Return a model without a sea bed."""
    model = scene(package, 0.002).compile()
    model.geom_contype[:] = 0
    return model


def command(rov: Any, share: float) -> None:
    rov.data.ctrl[:] = share * rov.model.actuator_ctrlrange[:, 1]


@pytest.mark.parametrize("older", [False, True], ids=["of one format", "one of an older format"])
def test_several_kinds_in_one_scene_move_as_each_alone(older: bool) -> None:
    """Each kind has a library of its own. One of them has a current, which another kind does not have at its place."""
    packages = [loaded(name)[1] for name in ("every_option", "videoray", "bluerov2", "videoray")]
    spec, prefixes = scene(packages[0], 0.002), ["", "1_", "2_", "3_"]
    for n, package in enumerate(packages[1:], 1):
        part = mujoco.MjSpec.from_file(str(package.FOLDER / "vehicle.xml"))
        spec.attach(part, prefix=f"{n}_", frame=spec.worldbody.add_frame(pos=[0.0, 9.0 * n, 0.0]))
    model = spec.compile()
    model.geom_contype[:] = 0
    data = mujoco.MjData(model)
    together = [package.Rov(model, data, prefix) for package, prefix in zip(packages, prefixes, strict=True)]
    together[2].FORMAT -= older
    alone = [package.Rov(world(package)) for package in packages]
    for n in range(120):
        for rov in (*together, *alone):
            rov.data.ctrl[rov._actuators] = (0.6, -0.3, 0.2)[n // 50] * rov.model.actuator_ctrlrange[rov._actuators, 1]
            rov.inputs.update({name: 0.2 for name in rov.inputs if n == 30})
        packages[1].step(*together)
        for rov in alone:
            rov.step()
    for one, other in zip(together, alone, strict=True):
        assert one.forces == pytest.approx(other.forces, rel=1e-9, abs=1e-9)
        start = model.body_dofadr[one.body]
        assert data.qvel[start : start + 6] == pytest.approx(other.data.qvel, rel=1e-9, abs=1e-9)
        assert np.abs(other.data.qvel).max() > 0.05, "it moves"


def test_many_steps_at_once_are_as_many_steps() -> None:
    _, package = loaded("every_option")
    model = world(package)
    rovs = [package.Rov(model), package.Rov(model)]
    for rov in rovs:
        command(rov, 0.7)
    rovs[0].step(100)
    for _ in range(100):
        rovs[1].step()
    assert (rovs[0].data.qpos == rovs[1].data.qpos).all()


# ---- Copies ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("copied", [copy, deepcopy])
def test_a_copy_goes_on_by_itself_from_the_same_state(copied: Callable[[Any], Any]) -> None:
    """Also what lags and what waits for the dead time is copied. The original may be gone."""
    _, package = loaded("every_option")

    def fly(rov: Any, steps: int, share: float) -> Array:
        rov.data.ctrl[:] = share * rov.model.actuator_ctrlrange[:, 1]
        rov.step(steps)
        return np.array([*rov.data.qpos, *rov.data.qvel, *rov.forces.values()])

    model = world(package)
    original = package.Rov(model)
    original.coefficients["m_rov"] *= 1.1
    fly(original, 30, 0.6)
    other, twin = copied(original), copied(original)
    other.coefficients["m_rov"] *= 2.0
    assert original.coefficients["m_rov"] * 2.0 == other.coefficients["m_rov"]
    expected = fly(original, 20, 0.4)
    before = twin.data.qpos.copy()
    del original
    gc.collect()
    scrap = [np.full(1000, np.nan) for _ in range(1000)]
    assert (twin.data.qpos == before).all(), "it was not moved with the original"
    assert (fly(twin, 20, 0.4) == expected).all()
    assert np.abs(fly(other, 20, 0.4) - expected).max() > 1e-4
    assert len(scrap) == 1000


def test_vehicles_that_are_copied_together_stay_together() -> None:
    _, package = loaded("bluerov2")
    spec = scene(package)
    part = mujoco.MjSpec.from_file(str(package.FOLDER / "vehicle.xml"))
    spec.attach(part, prefix="other_", frame=spec.worldbody.add_frame(pos=[0.0, 3.0, 0.0]))
    model = spec.compile()
    data = mujoco.MjData(model)
    both = [package.Rov(model, data, prefix) for prefix in ("", "other_")]
    package.step(*both)
    copies = deepcopy(both)
    assert copies[0].data is copies[1].data is not data
    for rovs in (both, copies):
        rovs[0].data.ctrl[:] = 0.3
        package.step(*rovs, steps=20)
    assert (copies[0].data.qpos == data.qpos).all()
    with pytest.raises(ValueError, match=r"^step: all vehicles must be in the same simulation"):
        package.step(both[0], copies[1])


def test_data_that_are_moved_in_turn_move_as_each_alone() -> None:
    """To the bit, although lag, dead time, rotors, loads and the number of steps differ."""
    _, package = loaded("every_option")
    model = world(package)

    def fly(rovs: list[Any], steps: Callable[[int], int]) -> list[Array]:
        datas = [mujoco.MjData(model) for _ in range(3)]
        for n in range(60):
            for k, data in enumerate(datas):
                rov = rovs[k % len(rovs)]
                rov.data = data
                command(rov, 0.2 * k * (1 + n // 20))
                data.qfrc_applied[0] = 3.0 * k * (n % 7)
                rov.step(steps(k))
        return [np.array([*data.qpos, *data.qvel, *data.act]) for data in datas]

    together = fly([package.Rov(model)], lambda k: k + 1)
    for k, found in enumerate(together):
        rov = package.Rov(model)
        for n in range(60):
            command(rov, 0.2 * k * (1 + n // 20))
            rov.data.qfrc_applied[0] = 3.0 * k * (n % 7)
            rov.step(k + 1)
        assert (found == [*rov.data.qpos, *rov.data.qvel, *rov.data.act]).all()


def saved_state(model: Any, data: Any) -> Any:
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_PHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_PHYSICS)
    return state


@pytest.mark.parametrize("how", ["copied", "set", "copied to other data", "another vehicle"])
def test_what_mujoco_saves_and_coefficients_are_all_that_the_motion_depends_on(how: str) -> None:
    _, package = loaded("every_option")
    model = world(package)
    rov, kept = package.Rov(model), mujoco.MjData(model)
    command(rov, 0.6)
    rov.step(300)
    command(rov, -0.3)
    rov.step(3)
    mujoco.mj_copyData(kept, model, rov.data)
    state = saved_state(model, rov.data)
    rov.coefficients |= {name: 1.1 * x for name, x in rov.coefficients.items()}
    rov.inputs["V_E"] = 0.2

    def rest() -> Array:
        command(rov, 0.5)
        rov.step(120)
        return np.array([*rov.data.qpos, *rov.data.qvel, *rov.forces.values()])

    expected, forces = rest(), rov.forces
    rov.step(100)
    assert rov.forces != forces
    if how == "copied":
        mujoco.mj_copyData(rov.data, model, kept)
    elif how == "set":
        mujoco.mj_setState(model, rov.data, state, mujoco.mjtState.mjSTATE_PHYSICS)
    elif how == "copied to other data":
        rov.data = kept
    else:
        rov = package.Rov(model, kept, **rov.coefficients)
        rov.inputs["V_E"] = 0.2
    assert (rest() == expected).all()


def test_data_of_another_model_and_a_model_without_memory_are_one_line() -> None:
    _, package = loaded("bluerov2")
    rov = package.load()
    before = rov.data
    for other in (loaded("videoray")[1], loaded("every_option")[1]):
        with pytest.raises(ValueError, match=r"^data: must be those of the vehicle's model"):
            rov.data = mujoco.MjData(other.load().model)
        with pytest.raises(ValueError, match=r"^data: must be those of the vehicle's model"):
            package.Rov(rov.model, mujoco.MjData(other.load().model))
    assert rov.data is before
    with pytest.raises(AttributeError):
        rov.model = None
    spec = scene(package)
    spec.actuator("u_1").dyntype = mujoco.mjtDyn.mjDYN_NONE
    spec.actuator("u_1").actdim = 0
    with pytest.raises(ValueError, match=r'^actuator u_1: must have dyntype="user" and actdim="\d+" or more'):
        package.Rov(spec.compile())


# ---- Threads, and functions in Python --------------------------------------------------------------------------------


def test_scenes_move_in_threads_as_one_after_the_other() -> None:
    packages = [loaded(name)[1] for name in ("every_option", "bluerov2_heavy", "every_option", "videoray")]

    def fly(package: ModuleType) -> Array:
        rov = package.load()
        rov.data.ctrl[:] = 0.5 * rov.model.actuator_ctrlrange[:, 1]
        for _ in range(50):
            rov.step(10)
        return np.asarray(rov.data.qpos)

    with ThreadPoolExecutor(4) as pool:
        found = [*pool.map(fly, packages)]
    assert all((one == fly(package)).all() for one, package in zip(found, packages, strict=True))


def test_other_threads_run_during_many_steps() -> None:
    rov = loaded("bluerov2")[1].load()
    with ThreadPoolExecutor(1) as pool:
        job, turns = pool.submit(rov.step, 20_000), 0
        while not job.done():
            time.sleep(1e-4)
            turns += 1
    assert rov.data.time == pytest.approx(40.0)
    assert turns > 20


@pytest.fixture
def callback() -> Iterator[Callable[[Any], None]]:
    yield mujoco.set_mjcb_control
    mujoco.set_mjcb_control(None)


def test_a_function_in_python_that_mujoco_calls_acts_and_its_error_is_raised(callback: Any) -> None:
    rov, other = (loaded("bluerov2")[1].load() for _ in range(2))
    other.data.ctrl[:] = 0.4
    other.step(20)

    def command(_: Any, data: Any) -> None:
        data.ctrl[:] = 0.4

    callback(command)
    rov.step(20)
    assert rov.data.qpos == pytest.approx(other.data.qpos, abs=1e-12)
    callback(lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        rov.step(20)


# ---- Errors of MuJoCo ------------------------------------------------------------------------------------------------


def without_frame(rov: Any) -> Any:
    """Return a vehicle whose first step MuJoCo 4.0 cannot take: it is in the sea bed, and may fall asleep there."""
    rov.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    rov.data.qpos[2] = -5.0
    return rov


def test_an_error_of_mujoco_is_an_exception_and_the_data_go_on_after_a_reset() -> None:
    """Also with several libraries, in several threads, and in MuJoCo's own functions."""
    packages = [loaded(name)[1] for name in ("bluerov2", "every_option", "bluerov2", "videoray")]

    def fly(package: ModuleType) -> bool:
        rov, other, fresh = without_frame(package.load()), without_frame(package.load()), package.load()
        with pytest.raises(mujoco.FatalError) as caught:
            rov.step(5000)
        with pytest.raises(mujoco.FatalError, match=re.escape(str(caught.value))):  # by MuJoCo's functions in Python
            package.plugin._step_by_parts((other,), 5000)
        rov.model.opt.enableflags = 0
        mujoco.mj_resetData(rov.model, rov.data)
        for one in (rov, fresh):
            command(one, 0.3)
            one.step(50)
        return bool(str(caught.value)) and bool((rov.data.qpos == fresh.data.qpos).all())

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(fly, packages))


# ---- What it refuses -------------------------------------------------------------------------------------------------


def test_more_commands_than_the_model_keeps_are_one_line_and_lose_nothing() -> None:
    _, package = loaded("every_option")
    spec = scene(package, 1e-4)
    first = next(iter(package.equation.COMMANDS))
    rov = package.Rov(spec.compile())
    room = (rov.model.actuator(first).actnum[0] - rov.library.kept) // rov.library.change
    assert room == max(64, np.ceil(1000.0 * package.equation.COEFFICIENTS["T_d"]))
    rov.coefficients["T_d"] = 0.5

    def send(count: int) -> None:
        for n in range(count):
            command(rov, (n + 1) / 4000.0)
            rov.step()

    send(room)
    before = rov.data.act.copy()
    command(rov, 0.5)
    with pytest.raises(ValueError, match=r"^more changes of commands wait .* raise actdim"):
        rov.step()
    assert (rov.data.act == before).all()
    spec.actuator(first).actdim = rov.library.kept + 1100 * rov.library.change
    rov = package.Rov(spec.compile())
    rov.coefficients["T_d"] = 0.5
    send(1024)
    with pytest.raises(ValueError, match=r"^more changes of commands wait"):
        send(1)


def test_coefficients_change_within_their_bounds_and_are_never_added_or_removed() -> None:
    _, package = loaded("every_option")
    rov = package.load()
    rov.coefficients |= {"m_rov": 7.0}
    rov.inputs = {"V_N": 0.3}
    assert (rov.coefficients["m_rov"], rov.inputs["V_N"], rov.inputs["V_E"]) == (7.0, 0.3, 0.0)
    assert eval(repr(rov.inputs)) == dict(rov.inputs)
    with pytest.raises(ValueError, match=r"^m_rov: a coefficient or an input can only change$"):
        del rov.coefficients["m_rov"]
    for name, value in (("m_rov", np.nan), ("m_rov", -50.0), ("T_d", 0.0), ("T_d", 1e9), ("beta_u", -1.0)):
        with pytest.raises(ValueError, match=rf"^{name} = .*: must be a number within .* \.\.\. "):
            rov.coefficients[name] = value
        with pytest.raises(ValueError, match=rf"^{name} = "):
            package.load(**{name: value})
    with pytest.raises(ValueError, match=r"^V_N = nan: must be a number within -inf"):
        rov.inputs["V_N"] = np.nan
    assert (rov.coefficients["m_rov"], rov.inputs["V_N"]) == (7.0, 0.3)


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, r"there is no water_\w+, .* rov-fmu export videoray"), (b"no library", "cannot be loaded")],
)
def test_without_a_library_that_fits_there_is_one_line(content: bytes | None, message: str, tmp_path: Path) -> None:
    _, package = loaded("videoray")
    here = next(package.FOLDER.glob(f"water_{sys.platform}_*"))
    if content:
        (tmp_path / here.name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        package.plugin.connect(tmp_path, package.equation, package.load().model)


def test_a_library_of_another_vehicle_is_one_line() -> None:
    (_, package), (_, other) = loaded("videoray"), loaded("bluerov2")
    with pytest.raises(ValueError, match="the library belongs to another vehicle"):
        package.plugin.connect(other.FOLDER, package.equation, package.load().model)


def test_without_the_library_of_mujoco_the_reason_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    _, package = loaded("videoray")
    monkeypatch.setattr(mujoco, "__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(ValueError, match=r"^MuJoCo .*: its library cannot be used"):
        package.load()


def test_a_machine_without_a_library_of_ours_exports_its_own(tmp_path: Path) -> None:
    bare = rov_fmu.load(BARE)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("platform.machine", lambda: "riscv64")
        patched.setattr("rov_fmu.bridges.mujoco.is_zig", lambda _: False)
        files = mujoco_files(mujoco_texts(bare, "rov", {}, {}))
        name = f"water_{sys.platform}_riscv64.so"
        assert [*filter(lambda file: file.startswith("water_"), files)] == [name]
        (tmp_path / name).write_bytes(bytes(files[name]))  # type: ignore[arg-type]
        package = loaded("videoray")[1]
        assert package.plugin.library_name() == f"water_{sys.platform}_riscv64"


@pytest.mark.long
def test_the_folder_has_the_c_and_its_libraries_for_all_systems() -> None:
    bare = rov_fmu.load(BARE)
    files = mujoco_files(mujoco_texts(bare, "rov", {}, {}))
    begins = {
        "water_linux_x86_64.so": b"\x7fELF",
        "water_linux_aarch64.so": b"\x7fELF",
        "water_win32_x86_64.dll": b"MZ",
        "water_darwin_x86_64.dylib": b"\xcf\xfa\xed\xfe",
        "water_darwin_aarch64.dylib": b"\xcf\xfa\xed\xfe",
    }
    libraries = {name: file for name, file in files.items() if isinstance(file, bytes)}
    assert {name: file[: len(begins[name])] for name, file in libraries.items()} == begins
    assert water_sources(bare.layout).items() <= files.items()
