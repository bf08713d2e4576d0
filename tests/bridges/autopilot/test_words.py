"""The words by which the autopilot and the companions describe themselves."""

import subprocess
import sys
from dataclasses import replace
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

import rov_fmu
from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import autopilot_model
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ROOT, python

SIX = load_vehicle(SHIPPED["bluerov2"])


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("step", [0.02, 0.05])
def test_the_default_experiment_has_the_step_that_the_gains_are_made_for(step: float, fmi: int) -> None:
    content = native_content(autopilot_model(autopilot_of(SIX, step)), fmi=fmi, interface="cs")
    experiment = fromstring(content.files["modelDescription.xml"]).find("DefaultExperiment")
    assert experiment is not None
    assert float(experiment.attrib["stepSize"]) == step


def test_inputs_say_what_they_are() -> None:
    about = {one.name: one.description for one in autopilot_model(autopilot_of(SIX)).variables}
    assert about["stick_u"] == "Share of the largest force in surge"
    assert about["stick_r"] == "Share of the largest torque in yaw"
    assert about["ref_x"] == "North to hold; needs mode 2 of surge and of sway"
    assert about["ref_y"] == "East to hold; needs mode 2 of surge and of sway"
    assert (about["ref_z"], about["ref_psi"]) == ("Depth to hold", "Heading to hold")


def test_the_gains_are_printed_on_a_screen() -> None:
    lines = str(rov_fmu.load("bluerov2_heavy").autopilot().autopilot).splitlines()
    assert lines[0] == "Autopilot of bluerov2_heavy, for a step of 0.02 s and a delay of 0.015 s"
    assert [line.partition(":")[0] for line in lines[1:]] == ["surge", "sway", "heave", "roll", "pitch", "yaw"]
    assert max(map(len, lines)) < 100


def test_a_terminal_that_a_vehicle_lacks_says_what_to_write() -> None:
    layout = replace(SIX.layout, waves=False)
    content = native_content(SIX.with_(layout), interface="cs").files
    fmu = SystemFmu.open(ROOT / "rov.fmu", archive(content), is_ours=True)
    assert fmu.unknown("battery").endswith("'battery': write [battery] in the vehicle file")
    assert fmu.unknown("waves").endswith("write waves = true above the tables of the vehicle file")
    assert "write" not in fmu.unknown("batery")


_STEP = """
from rov_fmu.bridges.system.companions.tether import Tether
one = Tether(instance_name="one")
one.z_bottom = 30.0
print(one.do_step(0.0, 0.02))
"""


def test_moordyn_prints_nothing_into_an_importer() -> None:
    pytest.importorskip("moordyn")
    assert python("-c", _STEP) == "True\n"


@pytest.mark.parametrize("name", ["battery", "current", "seaway", "tether"])
def test_random_inputs_of_a_companion_end_no_process(name: str) -> None:
    """Whatever numbers come in, a step is done, refused, or raises what PythonFMU turns into a message."""
    if name == "tether":
        pytest.importorskip("moordyn")
    ran = subprocess.run(
        [sys.executable, "-m", "tests.bridges.system.random_inputs", name, "1"],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert (ran.returncode, ran.stdout.splitlines()[-1:]) == (0, ["done"]), ran.stderr


def test_the_page_says_which_mean_period_is_longer() -> None:
    """Of JONSWAP up to four times the peak: T_m01 = m_0/m_1 and T_m02 = √(m_0/m_2), against all frequencies."""
    ratio = np.linspace(0.5, 400.0, 2_000_000)
    sigma = np.where(ratio <= 1.0, 0.07, 0.09)
    density = ratio**-5 * np.exp(-1.25 * ratio**-4) * 3.3 ** np.exp(-0.5 * ((ratio - 1.0) / sigma) ** 2)
    longer = []
    for n in (1, 2):
        whole, cut = ([np.trapezoid((density * ratio**k)[some], ratio[some]) for k in (0, n)] for some in
                      (slice(None), ratio <= 4.0))  # fmt: skip
        longer.append((cut[0] / cut[1] / (whole[0] / whole[1])) ** (1.0 / n) - 1.0)
    assert [f"{100.0 * one:.0f}" for one in longer] == ["1", "3"]
    assert "T_m02 3 % longer, and T_m01 1 %" in (ROOT / "docs" / "waves.md").read_text(encoding="utf-8")
