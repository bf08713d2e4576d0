"""The recipes of docs/extending.md, applied to a copy of the program: what they add is everywhere, or told as missing.

A force with a coefficient of its own (e_d), an effect on the thrust that depends on a state (k_z), an output with a new
unit (power), a log format (.jsonl), and an export (coefficients).
"""

import json
import os
import shutil
from typing import Any

import pytest

from tests.commands import ROOT, python

_BEHIND, _BEFORE = "behind", "before"
RECIPES = {
    "equation/catalogue.py": [
        (
            _BEFORE,
            '    "F_0": Declaration(',
            """\
    "e_d": Declaration("{load}.s2/{length}2", "Drag e_d of the tether in {axis}", 0.0, 1e6, needed=False),
""",
        ),
        (
            _BEFORE,
            '    "T": Declaration("s", "Time constant',
            """\
    "k_z": Declaration("1/m", "Loss of thrust k_z of the {curve} per depth", 0.0, 1.0, needed=False),
""",
        ),
    ],
    "equation/forces.py": [
        (_BEHIND, "from .parts import FAINT, Curve, Thruster, effect_along\n", "from .thrust import steady_name\n"),
        (
            _BEFORE,
            'LIFT = Effect("lift"',
            """\
TETHER = Effect("tether", "drag of the tether (e_d)")
DEPTH = Effect("depth", "the loss of thrust with the depth (k_z)")
""",
        ),
        (
            _BEHIND,
            "        yield Force(QUADRATIC, axis, -(a_d * abs(v) * v))  # X_|u|u |u| u\n",
            """\
        if "e_d" in one.keys:
            yield Force(TETHER, axis, -(Name(one.coefficient("e_d")) * abs(v) * v))
""",
        ),
        (_BEFORE, "\n\ndef effects_of(", "    yield from _deep(layout, names)\n"),
        (
            _BEFORE,
            "def _restoring(",
            '''\
def _deep(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield the loss of thrust with the depth."""

    def lost(thruster: str, curve: Curve) -> Expression:
        return Name(curve.coefficient("k_z")) * steady_name(thruster, curve, names)

    for axis in layout.bare_axes if "z" in layout.pose else ():
        curves = [curve for curve in layout.curves if "k_z" in curve.keys]
        if parts := [part for curve in curves for part in thrusts(layout, axis, names, curve, lost)]:
            yield Force(DEPTH, axis.velocity, -(Name(axis.coefficient("alpha")) * total(parts) * Name("z")))


''',
        ),
    ],
    "equation/layout.py": [
        (
            _BEHIND,
            "return self.over_ground | self.electric",
            """ | {
            "pressure": Declaration("Pa", "Pressure behind all thrusters")
        }""",
        ),
    ],
    "equation/terms.py": [
        (
            _BEFORE,
            "\n    def _is_constant(",
            """\
        self.forces["pressure"] = total(10.0 * abs(Name(f"F_{thruster.name}")) for thruster in layout.thrusters)
""",
        ),
    ],
    "equation/units.py": [
        (_BEFORE, '    "N": Unit(', '    "Pa": Unit("Pressure", "pressure", {"kg": 1, "m": -1, "s": -2}),\n'),
    ],
    "tank/readers/parsers.py": [
        (
            _BEHIND,
            "from rov_fmu.tank.readers.ulog import read_ulog\n",
            """\
from rov_fmu.tank.readers.jsonl import open_jsonl
""",
        ),
        (_BEFORE, "    TABLE,\n)", '    Format("a file of JSON lines", rb"{", open_jsonl),\n'),
    ],
    "interface/export_command.py": [
        (
            _BEFORE,
            "\n\nEXPORTS = {",
            """

def _coefficients(job: Job) -> Exported:
    from rov_fmu.bridges.coefficients import coefficients_json

    return Exported({"coefficients.json": coefficients_json(job.vehicle)}, ["it has no equation"])
""",
        ),
        (
            _BEFORE,
            '        Export("sdf"',
            '        Export("coefficients", "_values", _coefficients, "its coefficients (JSON)", "json"),\n',
        ),
    ],
    "io/file_kinds.py": [(_BEHIND, "ULOG_SUFFIX, *BAG_SUFFIXES", ', ".jsonl"')],
}
"""What each file gets, before or behind a text in it."""
JSONL = '''\
"""Read a log whose lines are objects of JSON."""

import json
from functools import partial
from io import StringIO
from pathlib import Path

from rov_fmu.io.csv_table import OpenStream


def open_jsonl(path: Path) -> OpenStream:
    """Return a function that opens the rows as the lines of a CSV file."""
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    lines = [",".join(rows[0]), *(",".join(map(str, row.values())) for row in rows)]
    return partial(StringIO, "\\n".join(lines))
'''
COEFFICIENTS = '''\
"""Write the coefficients of a vehicle as JSON."""

import json

from rov_fmu.vehicle.vehicle import Vehicle


def coefficients_json(vehicle: Vehicle) -> str:
    """Return the coefficients by their names, in SI units."""
    return json.dumps(dict(vehicle.coefficients))
'''
CHECK = """
import json, sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from rov_fmu.cli import main
from rov_fmu.bridges import allocation, arrays, mujoco, sdf, urdf
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.fmu.content import native_content
from rov_fmu.fmu.terminals import terminals
from rov_fmu.io.file_kinds import LOG_SUFFIXES
from rov_fmu.report.page.equations import equations_of
from rov_fmu.tank.columns import ColumnNames
from rov_fmu.tank.readers.parsers import format_of
from rov_fmu.tank.readers.tables import read_table
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

base = load_vehicle(SHIPPED["videoray"])
own = {"e_d_w": 60.0, "k_z_top": 0.01}
rov = base.with_(base.layout.extended(own), **own)
inputs = rov.layout.usual_inputs | {"u_t": 0.5}
state = rov.layout.at_rest | {"w": 0.2, "z": 5.0}
whole, half = rov.step(inputs, state, 1.0), rov.step(inputs, rov.step(inputs, state, 0.5), 0.5)
dive = Path(sys.argv[1])
log, entries = read_table(dive, rov.layout, HEAVE, ColumnNames(), format_of(dive).open(dive))
files = mujoco.mujoco_texts(rov, "rov", {}, {})
content = native_content(rov, fmi=3).files
forces = arrays.forces(rov, inputs, {})
rates = arrays.rates(rov, [state[name] for name in rov.layout.state], forces, {})
found = {
    "inertia": 1.0 / (rov.derivatives(inputs | {"Z_ext": 1.0}, state)["w"] - rov.derivatives(inputs, state)["w"]),
    "change": rov.derivatives(inputs, state)["w"] - base.derivatives(inputs, state)["w"],
    "thrust": base["alpha_w"] * base.commanded(inputs)["t"],
    "apart": max(abs(whole[name] - half[name]) for name in whole),
    "alone": [rov.response(HEAVE, 0.5)[0], rov.force(HEAVE, 0.5), rov["alpha_w"], rov["a_d_w"], rov["b_d_w"]],
    "pressure": rov.calculated(inputs, state)["pressure"],
    "F_t": rov.calculated(inputs, state)["F_t"],
    "description": content["modelDescription.xml"].decode(),
    "equation": content["sources/equation.h"].decode(),
    "page": str([*equations_of(rov.layout)]),
    "arrays": float(rates[[*rov.layout.state].index("w")]),
    "w": rov.derivatives(inputs, state)["w"],
    "gazebo": sdf.gazebo_model(rov).notes,
    "urdf": urdf.urdf_model(rov).notes,
    "allocation": allocation.allocation_files(rov)["allocation.yaml"],
    "mujoco": files["README.md"],
    "terminals": {one.name: one.variables for one in terminals(rov.layout)},
    "read": [*entries],
    "suffixes": LOG_SUFFIXES,
}
def printed(*arguments):
    with redirect_stdout(StringIO()) as out, redirect_stderr(out):
        main(["export", "videoray", *arguments])
    return out.getvalue()

found |= {
    "export": [printed("--to", "coefficients"), Path("videoray_values/coefficients.json").read_text()],
    "refused": [printed("--to", "json"), printed("--to", "coefficients", "--world")],
    "own": dict(base.coefficients),
}
swims = mujoco.load_mujoco(rov)
swims.model.opt.timestep, swims.data.actuator("u_t").ctrl, swims.data.qvel[2] = 1e-9, inputs["u_t"], -state["w"]
swims.step()
found["mujoco w"] = [-float(swims.data.qacc[2]), rov.derivatives(inputs, state | {"z": 0.0})["w"]]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a copy of the program with the additions says about a vehicle that has them."""
    scratch = tmp_path_factory.mktemp("recipes")
    package = scratch / "rov_fmu"
    shutil.copytree(ROOT / "rov_fmu", package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("fmu_src", "models", "LICENSE"):
        (scratch / name).symlink_to(ROOT / name)
    for name, edits in RECIPES.items():
        text = (package / name).read_text(encoding="utf-8")
        for where, anchor, new in edits:
            assert text.count(anchor) == 1, f"{name} has no longer {anchor!r}, which docs/extending.md describes"
            text = text.replace(anchor, f"{anchor}{new}" if where == _BEHIND else f"{new}{anchor}")
        (package / name).write_text(text, encoding="utf-8")
    for name, text in {"tank/readers/jsonl.py": JSONL, "bridges/coefficients.py": COEFFICIENTS}.items():
        (package / name).write_text(text, encoding="utf-8")
    rows = ({"time [s]": 0.1 * n, "command [%]": 30, "depth [m]": 0.01 * n} for n in range(100))
    (scratch / "dive_heave.jsonl").write_text("\n".join(map(json.dumps, rows)), encoding="utf-8")
    there = {"env": {**os.environ, "PYTHONPATH": str(scratch)}, "cwd": scratch}
    answers: dict[str, Any] = json.loads(python("-c", CHECK, str(scratch / "dive_heave.jsonl"), **there))
    return answers


def test_a_force_and_an_effect_on_the_thrust_move_the_vehicle(found: dict[str, Any]) -> None:
    lost = 60.0 * 0.2 * 0.2 + found["thrust"] * 0.01 * 5.0  # e_d |w| w, and the share k_z z of the thrust
    assert found["change"] * found["inertia"] == pytest.approx(-lost, rel=1e-12)
    assert found["apart"] < 1e-13, "two half steps are a step"
    assert found["arrays"] == pytest.approx(found["w"], rel=1e-13)
    V, force, alpha, a_d, b_d = found["alone"]
    assert (a_d + 60.0) * V * V + b_d * V == pytest.approx(alpha * force, rel=1e-12)


def test_every_file_of_the_fmu_has_them(found: dict[str, Any]) -> None:
    for name in ("e_d_w", "k_z_top"):
        assert f'name="{name}"' in found["description"]
    assert "tether_w" in found["equation"]
    assert "e_d_w" in found["page"]


def test_every_bridge_has_them_or_tells_that_it_lacks_them(found: dict[str, Any]) -> None:
    tether, depth = "drag of the tether (e_d)", "the loss of thrust with the depth (k_z)"
    for bridge in ("gazebo", "urdf"):
        assert {f"left out: {tether}", f"left out: {depth}"} <= {*found[bridge]}, bridge
    for words in (tether, depth):
        assert f"# Left out: {words}." in found["allocation"]
    assert f"Left out: {depth}" in found["mujoco"]
    assert f"Left out: {tether}" not in found["mujoco"]
    in_mujoco, at_the_surface = found["mujoco w"]
    assert in_mujoco == pytest.approx(at_the_surface, rel=1e-6), "it has the tether, and the thrust without the loss"


def test_an_output_with_a_new_unit_is_in_every_list(found: dict[str, Any]) -> None:
    assert found["pressure"] == 10.0 * abs(found["F_t"])
    assert '<BaseUnit kg="1" m="-1" s="-2"/>' in found["description"]
    assert 'name="pressure"' in found["description"]
    assert found["terminals"]["other_outputs"] == ["pressure"]


def test_a_log_in_a_new_format_is_read_as_every_table_is(found: dict[str, Any]) -> None:
    assert {*found["read"]} == {"command [%]", "depth [m]"}
    assert ".jsonl" in found["suffixes"]


def test_an_export_is_a_format_of_the_command(found: dict[str, Any]) -> None:
    printed, content = found["export"]
    assert json.loads(content) == found["own"]
    assert "Note:\n- it has no equation\n" in printed
    assert "Wrote videoray_values" in printed
    unknown, foreign = found["refused"]
    assert "did you mean coefficients?" in unknown
    assert "--to coefficients: leave out --world, because only sdf has it" in foreign
