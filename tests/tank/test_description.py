"""The description of a vehicle in rov.toml, and the vehicle that its tests identify."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SWAY
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.identify import identify
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.findings import Finding, sentences
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle, without_surface
from tests.commands import TESTS
from tests.folders import (
    BLUEROV2,
    DOWN,
    FORCE,
    HEAD,
    SPEED,
    VECTORED,
    folder_of,
    pulled,
    read,
    responses,
)
from tests.often import spread
from tests.recordings import run, write_log
from tests.tank.logs import commanded
from tests.tank.readers import writers
from tests.tank.readers.motion import DIVE, THRUSTERS, TIME
from tests.tank.test_description_mistakes import LIMITS

DOCS = Path(__file__).parents[2] / "docs"
VECTORED_DIVE = "\n".join(
    ["time [s],1 [%],2 [%],3 [%],4 [%],5 [%],6 [%],depth [m]"]
    + [
        f"{0.1 * n},0,0,0,0,{40 * (n % 40 > 20)},{40 * (n % 40 > 20)},{2 + 0.5 * np.sin(0.1 * n):.3f}"
        for n in range(200)
    ]
)


def test_the_owner_may_correct_the_geometry_of_a_base_that_a_draft_tells(tmp_path: Path) -> None:
    """Each vectored thruster keeps its signs, and the others stay where they are."""
    base = load_vehicle(SHIPPED["bluerov2"]).layout
    own = "[geometry]\nangle = 40\nx = 0.16\n"
    tests = read(tmp_path, f'base = "bluerov2"\n{HEAD}{own}', {"dive.csv": VECTORED_DIVE})
    for before, now in zip(base.thrusters, tests.layout.thrusters, strict=True):
        (X, Y, Z), (x, y, z) = now.direction.value, now.place
        if before.name in "56":
            assert now == before
            continue
        assert np.degrees(np.arctan2(abs(Y), abs(X))) == pytest.approx(40.0)
        assert np.hypot(X, Y) == pytest.approx(1.0)
        assert np.sign([X, Y, x, y]).tolist() == np.sign([*before.direction.value[:2], *before.place[:2]]).tolist()
        assert (abs(x), y, z, Z) == (0.16, *before.place[1:], 0.0)
        assert now.position
        assert now.direction.source == now.position.source == "[geometry] of rov.toml"
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "dive.csv").write_text(VECTORED_DIVE, encoding="utf-8")
    assert main(["inspect", "--draft", str(tmp_path / "other" / "dive.csv")]) == 0
    draft = (tmp_path / "other" / ROV_FILE).read_text(encoding="utf-8")
    assert "# angle = 45   # degrees from ahead or astern\n# x = 0.156   # m ahead" in draft


# ---- What is about known, and what is reversed -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("thrust", "force"),
    [
        ('thrust = { about = 14.0, unit = "N" }', 14.0),
        ('thrust = { about = 2.0, unit = "kgf" }\ntogether = 3', 3.0 * 2.0 * 9.80665),
    ],
)
def test_thrust_may_be_known_about(thrust: str, force: float, tmp_path: Path) -> None:
    """It is the centre of a prior: the fit may change it, and forces that are measured replace it."""
    rov = DOWN.replace("[curves.t200]", f"[curves.t200]\n{thrust}")
    folder = folder_of(tmp_path / "tests", rov, {"steady_heave.csv": f"{SPEED}\n0.3,0.2\n0.6,0.4\n"})
    tests = load_tests(folder)
    assert tests.base["a_t_t200"] + tests.base["b_t_t200"] == pytest.approx(force)
    known, _, _ = begin(tests)
    assert [curve.name for curve in known.curves] == ["t200"]
    assert not {"a_t_t200", "b_t_t200"} & known.exact
    (folder / "thrust_t200.csv").write_text(pulled(30.0, 20.0), encoding="utf-8")
    assert not {"a_t_t200", "b_t_t200"} & load_tests(folder).known.keys()


@pytest.mark.parametrize("write", [writers.csv, writers.tlog, writers.flash])
def test_a_motor_may_be_reversed_whatever_the_log_tells(
    write: Callable[[Path, writers.Dive], Path], tmp_path: Path
) -> None:
    write(tmp_path, DIVE)
    rov = f'{BLUEROV2}[logs]\nreversed = ["2", "5"]\n'
    (log,) = load_tests(folder_of(tmp_path, rov, {})).folder.logs
    assert log.commands
    for name, values in THRUSTERS.items():
        sign = -1.0 if name in ("2", "5") else 1.0
        assert commanded(log, name, TIME - TIME[0] + log.commands.rows[0]) == pytest.approx(sign * values, abs=3e-3)


# ---- A vehicle to begin from -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_log_stands_instead_of_all_of_its_axis(tmp_path: Path) -> None:
    """The log also replaces F_0, because another vehicle has another trim."""
    base = load_vehicle(SHIPPED["bluerov2"])
    folder = folder_of(tmp_path / "tests", BLUEROV2, {})
    true = base.with_(F_0_w=0.0, a_d_w=50.0, b_d_w=8.0, beta_w=0.9)
    plan = ((0.0, 2.0), (0.3, 5.0), (0.0, 4.0), (-0.5, 5.0), (0.8, 5.0))
    write_log(folder, "a", run(true, HEAVE, plan, 20.0).noisy(np.random.default_rng(0), noise=0.002))
    tests = load_tests(folder)
    assert tests.layout.by_name["heave"].keys == ("m_a", "a_d", "b_d")
    assert not {"F_0_w", "a_d_w", "b_d_w", "beta_w"} & {*tests.known}
    found = identify(tests).vehicle
    for name in ("a_d_w", "b_d_w", "beta_w"):
        assert found[name] == pytest.approx(true[name], rel=0.05)


@pytest.mark.parametrize(
    ("commands", "keys"),
    [((0.3, 0.6), ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "T")), ((0.3, 0.6, -0.4), ("a_t", "b_t", "T"))],
)
def test_thrust_ahead_leaves_reverse_as_it_is(
    commands: tuple[float, ...], keys: tuple[str, ...], tmp_path: Path
) -> None:
    base = load_vehicle(SHIPPED["bluerov2"])
    curve = base.layout.curves[0]
    rows = "".join(f"{c},{1.1 * base.curve_force(curve, c):.6f}\n" for c in commands)
    tests = read(tmp_path, BLUEROV2, {"thrust_T200.csv": f"{FORCE}\n{rows}"})
    assert tests.layout.curves[0].keys == keys
    if len(commands) == 2:
        found = identify(tests).vehicle
        assert found.curve_force(curve, 0.6) == pytest.approx(1.1 * base.curve_force(curve, 0.6), rel=2e-3)
        assert found.curve_force(curve, -0.6) == base.curve_force(curve, -0.6)


def test_a_base_gains_an_axis_by_its_tests(tmp_path: Path) -> None:
    """The vectored thrusters drive sway, which the file of the base does not have."""
    text = SHIPPED["bluerov2"].read_text(encoding="utf-8").replace("coupling = true", "")
    text = text[: text.index("[axes.sway]")] + text[text.index("[axes.heave]") :]
    folder = folder_of(tmp_path / "tests", HEAD, {})
    (folder / "old.toml").write_text(text, encoding="utf-8")
    table = '[axes.sway]\nm_a = { value = 7.0, unit = "kg", source = "a strip" }\n'
    k = load_vehicle(SHIPPED["bluerov2"]).with_(m_a_v=7.0)
    for also, keys in (("", ("a_d", "b_d")), (table, ("m_a", "a_d", "b_d"))):
        limits = LIMITS.format(-1, 1, 0.2, 0.21, 0, 1e4, 1e4)
        tests = read(folder, f'base = "old.toml"\n{HEAD}{also}{limits}', responses(k, SWAY))
        assert [*tests.layout.by_name] == ["surge", "sway", "heave", "yaw"]
        assert tests.layout.by_name["sway"].keys == keys
    inputs: list[Path] = []
    load_tests(folder, inputs.extend)
    assert folder / "old.toml" in inputs


@pytest.mark.parametrize("coupling", [None, True, False])
@pytest.mark.parametrize("base", ["bluerov2", "videoray"])
def test_the_coupling_of_the_base_can_be_changed(base: str, coupling: bool | None, tmp_path: Path) -> None:
    """A vehicle without sway, such as the VideoRay, cannot be coupled, and a fact says so."""
    vehicle = load_vehicle(SHIPPED[base])
    own = "" if coupling is None else f"[body]\ncoupling = {str(coupling).lower()}\n"
    tests = read(tmp_path, f'base = "{base}"\n{HEAD}{own}', responses(vehicle, HEAVE))
    wanted = vehicle.layout.coupled if coupling is None else coupling
    assert tests.layout.coupled == (wanted and base != "videoray")
    assert ("not coupled" in [finding.kind for finding in tests.folder.findings]) == (wanted and base == "videoray")


@pytest.mark.parametrize("own", ["", 'base = "videoray"\n', 'base = "../of/mine.toml"\n'])
def test_the_base_of_the_command_line_may_lie_anywhere(
    own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It replaces that of rov.toml, is an input, and is named in the result. A path in rov.toml stays in the folder."""
    elsewhere = tmp_path / "of" / "mine.toml"
    elsewhere.parent.mkdir()
    text = SHIPPED["bluerov2"].read_text(encoding="utf-8")
    elsewhere.write_text(text.replace("coupling = true", ""), encoding="utf-8")
    rows = responses(load_vehicle(SHIPPED["bluerov2"]), SWAY)
    folder = folder_of(tmp_path / "tests", f"{own}{HEAD}", rows)
    inputs: list[Path] = []
    tests = load_tests(folder, inputs.extend, elsewhere)
    assert elsewhere in inputs
    assert [*tests.folder.inputs][:2] == [ROV_FILE, "mine.toml"]
    assert not tests.layout.coupled
    assert load_tests(folder, base=SHIPPED["bluerov2"]).description.base_name == "bluerov2"
    for given, target, message in (
        (elsewhere, elsewhere, "would overwrite"),
        (tmp_path / "none.toml", tmp_path / "out.toml", f"{tmp_path / 'none.toml'}: there is no such file"),
    ):
        assert main(["identify", str(folder), "--base", str(given), "-o", str(target)]) == 2
        assert message in capsys.readouterr().err.splitlines()[-1]
    if ".." in own:
        with pytest.raises(VehicleFileError, match=r"base = .*must lead to a place inside the folder of this file"):
            load_tests(folder)


# ---- Hardware tables -------------------------------------------------------------------------------------------------


def test_an_axis_whose_thrusters_cancel_each_other_is_a_warning(tmp_path: Path) -> None:
    """The directions of two thrusters are opposite, so with equal commands they do not push along the axis."""
    rov = VECTORED + "".join(
        f'[[thruster]]\nname = "{name}"\ncurve = "t200"\ndirection = {{ value = [0, 0, {z}], source = "drawn" }}\n'
        f'position = {{ value = [{x}, 0, 0], unit = "m", source = "drawn" }}\n'
        for name, x, z in (("front", 0.1, 1), ("rear", -0.1, -1))
    )
    names = ["time [s]", *(f"u_{name} [1]" for name in "1234"), "u_front [1]", "u_rear [1]"]
    rows = (
        f"{0.1 * n:.1f},{'-0.2,-0.2,0.2,0.2,0.3,0.3' if n > 20 else '0,0,0,0,0,0'},{0.01 * n:.2f},{0.02 * n:.2f}"
        for n in range(100)
    )
    header = ",".join([*names, "surge distance [m]", "depth [m]"])
    tables = {"dive.csv": "\n".join([header, *rows]) + "\n", "thrust_t200.csv": pulled(30.0, 20.0)}
    tests = read(tmp_path, f"{rov}[axes.heave]\n", tables)
    assert [*tests.layout.by_name] == tests.logged == ["surge"]
    assert Finding("cancelling thrusters", "heave", file="dive.csv") in tests.folder.findings
    assert any(
        "heave: the logs have its motion, but in all of them its thrusters cancel each other" in line
        for line in by_heading(tests.folder.findings)["Warnings"]
    )


# ---- Requests and numbers that are given -----------------------------------------------------------------------------


@pytest.mark.parametrize(("lag", "curves"), [("true", ("rear", "top")), ('["top"]', ("top",))])
def test_lag_to_be_found(lag: str, curves: tuple[str, ...], tmp_path: Path) -> None:
    tests = Path(shutil.copytree(TESTS, tmp_path / "tests"))
    with (tests / ROV_FILE).open("a", encoding="utf-8") as file:
        file.write(f"\n[fit]\nlag = {lag}\n")
    assert load_tests(tests).description.requests.lag == curves


GIVEN = {"a_d_w": 40.0, "F_0_w": -1.0, "T_t200": 0.3, "c_0_t200": 0.02}


@pytest.mark.parametrize("names", spread([("a_d_w", "T_t200"), *((n,) for n in GIVEN)], (), [("a_d_w", "T_t200")]))
def test_a_number_of_rov_toml_is_in_the_vehicle_as_it_is(names: tuple[str, ...], tmp_path: Path) -> None:
    """Even where the log would rather have another one."""
    base = load_vehicle(SHIPPED["bluerov2"])
    units = base.layout.extended(names).coefficients
    known = [f'{name} = {{ value = {GIVEN[name]}, unit = "{units[name].unit}", source = "s" }}\n' for name in names]
    folder = folder_of(tmp_path / "tests", f"{BLUEROV2}[known]\n{''.join(known)}", {})
    plan = ((0.0, 2.0), (0.3, 5.0), (0.0, 4.0), (-0.5, 5.0), (0.8, 5.0))
    write_log(folder, "a", run(base, HEAVE, plan, 10.0).noisy(np.random.default_rng(0)))
    vehicle = identify(load_tests(folder)).vehicle
    for name in names:
        assert (vehicle[name], vehicle.sources[name]) == (GIVEN[name], "s")
        assert name not in vehicle.estimates


def test_the_rov_toml_of_the_docs(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(base = .*?)```", (DOCS / "identify.md").read_text(encoding="utf-8"), re.DOTALL)
    given = read(tmp_path, text, {"steady_heave.csv": f"{SPEED}\n0.3,0.2\n"})
    assert given.description.tables.vehicle
    assert given.description.tables.vehicle.name == "Our BlueROV2"
    assert given.layout == without_surface(load_vehicle(SHIPPED["bluerov2"])).layout


# ---- Keys of earlier versions ----------------------------------------------------------------------------------------


def test_keys_of_earlier_versions_are_read_and_one_line_says_that_nothing_uses_them(tmp_path: Path) -> None:
    rov, tables = f'base = "videoray"\n{HEAD}', {"steady_heave.csv": f"{SPEED}\n0.3,0.2\n0.6,0.4\n"}
    plain, old = (
        load_tests(folder_of(tmp_path / name, text, tables)).folder.findings
        for name, text in (("plain", rov), ("old", f'against = "gone.toml"\n{rov}[limits]\ndepth = 3.0\n'))
    )
    assert sentences(old) == (
        "against in rov.toml: not read, because a report compares with no other vehicle. `rov-fmu fly --against` does",
        "limits in rov.toml: not read, because the next test keeps to no limits",
        *sentences(plain),
    )
