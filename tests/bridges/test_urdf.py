"""The robot description: with Fossen's equations by its numbers, written out here, it moves as the FMU does.

The tags and their signs are those of Robotic-Decision-Making-Lab/hydrodynamics (src/hydrodynamics.cpp at 3c4db4e).
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree
from numpy.typing import NDArray

from rov_fmu.bridges.sdf import gazebo_model
from rov_fmu.bridges.urdf import urdf_model
from rov_fmu.cli import main
from rov_fmu.io.output import sealed
from tests.bridges.test_sdf import LOADED

SIX = ("Xu", "Yv", "Zw", "Kp", "Mq", "Nr")


def parsed(name: str) -> Any:
    root = etree.fromstring(urdf_model(LOADED[name]).text.encode())
    assert root.tag == "robot"
    return root


def six(hydrodynamics: Any, tag: str, form: str) -> NDArray[np.float64]:
    """Return the attributes of a tag, all of which the library requires."""
    element = hydrodynamics.find(tag)
    names = [form.format(*axis) for axis in SIX]
    assert [*element.attrib] == names
    return np.array([float(element.get(name)) for name in names])


@pytest.mark.parametrize("name", LOADED)
def test_each_axis_accelerates_as_the_vehicle_does(name: str) -> None:
    """One axis at a time moves, under a load from outside: m dv = tau + (X_u + X_uu |v|) v."""
    rov, element = LOADED[name], parsed(name).find("hydrodynamics")
    mass, inertia = float(element.find("mass").text), element.find("inertia")
    rigid = np.array([mass, mass, mass, *(float(inertia.get(f"i{axis}{axis}")) for axis in "xyz")])
    M = rigid - six(element, "added_mass", "{0}d{1}")
    linear, quadratic = (six(element, f"{n}_damping", f) for n, f in (("linear", "{0}{1}"), ("quadratic", "{0}{1}{1}")))
    level = rov.layout.at_rest
    weight, buoyancy = (float(element.find(tag).text) for tag in ("weight", "buoyancy"))
    own = [rov.coefficients.get(moment, 0.0) for moment in ("I_p", "I_q", "I_r")]
    for n in (n for n, v in enumerate("uvwpqr") if v not in rov.layout.by_velocity):
        assert (M[n], linear[n], quadratic[n]) == (rigid[n], 0.0, 0.0)
        assert n < 3 or name == "bare" or rigid[n] == max(own)
    assert weight == pytest.approx(rov.coefficients.get("W", rov["m_rov"] * 9.8))
    for form in rov.layout.axes:
        v = form.axis.velocity
        n = "uvwpqr".index(v)

        def rate(load: float, speed: float, v: str = v, external: str = form.axis.external) -> float:
            return rov.derivatives(rov.layout.usual_inputs | {external: load}, level | {v: speed})[v]

        if not rov.layout.cross and not any(rov.coefficients.get(f"{axis}_G") for axis in "xyz"):
            assert rate(3.0, 0.0) - rate(0.0, 0.0) == pytest.approx(3.0 / M[n], rel=1e-9)
            assert rate(0.0, 0.0) == pytest.approx((weight - buoyancy) / M[n] if v == "w" else 0.0, rel=1e-9)
            drag = (linear[n] + quadratic[n] * 0.7) * 0.7
            assert 0.5 * (rate(3.0, 0.7) - rate(3.0, -0.7)) == pytest.approx(drag / M[n], rel=1e-9)


@pytest.mark.parametrize("name", LOADED)
def test_the_plugin_has_the_numbers_of_the_model_for_gazebo(name: str) -> None:
    sdf = etree.fromstring(gazebo_model(LOADED[name], explicit=True).text.encode())
    (wanted,) = (p for p in sdf.iter("plugin") if p.get("name") == "gz::sim::systems::Hydrodynamics")
    (found,) = parsed(name).iter("plugin")
    numbers = [{child.tag: child.text for child in one if child.tag[:1] in "xyzkmn"} for one in (wanted, found)]
    assert numbers[0] == numbers[1]
    assert "xU" in numbers[0]


def test_the_command_writes_it_by_the_name_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export", "bluerov2", "--to", "urdf", "-o", "rov.urdf"]) == 0
    assert Path("rov.urdf").read_text(encoding="utf-8") == sealed(urdf_model(LOADED["bluerov2"]).text, "export")
    assert capsys.readouterr().out.endswith("Wrote rov.urdf.\n")
    assert main(["export", "bluerov2", "--to", "urdf", "--world"]) == 2
    assert "--to urdf: leave out --world, because only" in capsys.readouterr().err
