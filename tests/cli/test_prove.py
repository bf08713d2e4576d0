"""`rov-fmu prove`: whether an FMU, ours or any other, gives the results that it carries."""

import re
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import fmpy
import pytest
from pythonfmu import FmuBuilder

from rov_fmu.cli import main
from rov_fmu.fmu.archive import FOLDER, MANIFEST
from rov_fmu.fmu.reference_results import reference_results
from rov_fmu.prove.proof import prove_fmu
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ALONE, Capsys

Change = Callable[[bytes], bytes]
Files = Mapping[str, str | None]
"""Texts of files by their name in the FMU, or beside the manifest; None leaves a file out."""


def _with(fmu: Path, files: Files, path: Path, begin: str = "/", change: Change = bytes) -> Path:
    """Write a copy of an FMU with these files, and with changed members whose name begins with `begin`."""
    changed = {name if "/" in name else f"{FOLDER}/{name}": text for name, text in files.items()}
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(path, "w") as new:
        for member in set(old.namelist()) - changed.keys():
            content = old.read(member)
            new.writestr(member, change(content) if member.startswith(begin) else content)
        for name, text in changed.items():
            if text is not None:
                new.writestr(name, text)
    return path


# ---- Ours ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("interface", [None, pytest.param("co-simulation", marks=pytest.mark.long), "model-exchange"])
def test_the_videoray_proves_itself(interface: str | None, videoray_fmu: Path, capsys: Capsys) -> None:
    assert main(["prove", str(videoray_fmu), *(["--interface", interface] if interface else [])]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "FAIL" not in out
    assert out.startswith(f"{6 + 1} experiments, {6 * 2 + 7} results: {6 * 2 + 7} of {6 * 2 + 7} pass. ")
    found = prove_fmu(videoray_fmu, interface)
    assert max(f.deviation for f in found) < (1e-9 if interface == "model-exchange" else 1e-10)
    assert {f.tolerance for f in found} == {1e-7 if interface == "model-exchange" else 1e-9}


def test_a_binary_with_another_motion_is_found(videoray_fmu: Path, tmp_path: Path, capsys: Capsys) -> None:
    """The VideoRay's FMU with the results of a vehicle that is heavier by a millionth."""
    vehicle = tmp_path / "heavier.toml"
    vehicle.write_text(ALONE.replace("6.57", "6.57000657"), encoding="utf-8")
    results = {name: content.decode() for name, content in reference_results(load_vehicle(vehicle)).items()}
    other = _with(videoray_fmu, results, tmp_path / "other.fmu")
    assert main(["prove", str(other)]) == 1
    out, err = capsys.readouterr()
    failed = [line.split() for line in out.splitlines() if "FAIL" in line]
    assert err == f"rov-fmu: {other}: {len(failed)} of 19 results are not as expected\n"
    assert {line[4] for line in failed} == {"u", "w", "x", "y", "z"}, "its mass has no part in yaw"
    assert main(["prove", str(other), "--tolerance", "1e-5"]) == 0


# ---- Any other -------------------------------------------------------------------------------------------------------

_SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, Boolean

class Counter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.u, self.y, self.n, self.on = 2.0, 0.0, 0.0, 0, False
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Integer("n", causality=Fmi2Causality.output))
        self.register_variable(Boolean("on", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y += self.k * self.u * step_size
        self.n += 1
        self.on = self.y > 1.0
        if self.u > 9.0:
            raise ValueError("too fast")
        return True
"""
_FOREIGN: Files = {
    MANIFEST: """<fmiReferences xmlns:l="http://fmi-standard.org/fmi-ls-manifest" l:fmi-ls-version="1.0.0-alpha.1"
        l:fmi-ls-name="org.fmi-standard.fmi-ls-ref" l:fmi-ls-description="Layered Standard">
      <Related type="application/x-ma-ls-experiments" source="my%20tests/all.exp" role="experiment/smoke-test"/>
      <Related source="not-there.txt" role="document"/>
    </fmiReferences>""",
    f"{FOLDER}/my tests/all.exp": """<Experiments name="All">
      <Experiment name="step" startTime="0" stopTime="2" stepSize="0.5" tolerance="1e-6">
        <Parameters source="../k.ssv"/><Stimuli source="u.csv"/><References source="y.csv"/>
      </Experiment>
      <Experiment name="draft" tolerance="1e-6">
        <TransientSimulation startTime="0" stopTime="1" stepSize="0.25"/>
        <Stimuli source="u.csv"/><References source="%79.csv#x"/>
      </Experiment>
    </Experiments>""",
    f"{FOLDER}/k.ssv": """<ssv:ParameterSet version="1.0" name="k"
        xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
      <ssv:Parameters><ssv:Parameter name="k"><ssv:Real value="2"/></ssv:Parameter></ssv:Parameters>
    </ssv:ParameterSet>""",
    f"{FOLDER}/my tests/u.csv": '"time","u"\r\n0,1\r\n1,1\r\n1,-1\r\n2,-1\r\n',
    f"{FOLDER}/my tests/y.csv": "time,y,on\n0,0,false\n0.5,1,false\n1,2,true\n",
}


@pytest.fixture(autouse=True)
def quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow machine tells its progress, which is no part of what is compared here."""
    monkeypatch.setattr("rov_fmu.report.progress._EVERY", 1000.0)


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU of another exporter, Co-Simulation alone, with experiments that we did not write."""
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "counter.py").write_text(_SLAVE, encoding="utf-8")
    return _with(Path(FmuBuilder.build_FMU(folder / "counter.py", dest=folder)), _FOREIGN, folder / "foreign.fmu")


def test_an_fmu_of_another_exporter_is_proved(foreign: Path, capsys: Capsys) -> None:
    assert main(["prove", str(foreign)]) == 0
    found = [(f.experiment, f.variable, f.passed) for f in prove_fmu(foreign)]
    assert found == [(x, v, True) for x in ("step", "draft") for v in ("y", "on")]
    assert "missing" not in capsys.readouterr().out, "what FMPy and the FMU say stays out of the table"


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("my tests/y.csv", "time,y\n0,0\n1,2.00001\n", "step 5.0e-06 1.0e-06 FAIL y"),
        ("my tests/y.csv", "time,y\n0,0.001\n", "step 1.0e-01 1.0e-06 FAIL y"),  # relative to 1 % of the nominal value
        ("k.ssv", _FOREIGN[f"{FOLDER}/k.ssv"].replace('"2"', '"2.1"'), "step 5.0e-02 1.0e-06 FAIL y"),  # type: ignore[union-attr]
        ("my tests/u.csv", "time,u\n0,10\n", "step inf 1.0e-06 FAIL fmi2DoStep failed with status"),
        (
            "my tests/all.exp",
            _FOREIGN[f"{FOLDER}/my tests/all.exp"].replace(  # type: ignore[union-attr]
                "</Experiments>",
                '<Experiment name="runs" stopTime="1"><Stimuli source="u.csv"/></Experiment></Experiments>',
            ),
            "runs inf 1.0e-03 FAIL has no expected results, so nothing is compared",
        ),
    ],
)
def test_what_deviates_or_fails_is_printed(
    name: str, text: str, line: str, foreign: Path, tmp_path: Path, capsys: Capsys
) -> None:
    fmu = _with(foreign, {f"{FOLDER}/{name}": text}, tmp_path / "other.fmu")
    assert main(["prove", str(fmu)]) == 1
    out, err = capsys.readouterr()
    assert line in [" ".join(row.split())[: len(line)] for row in out.splitlines()]
    assert err.startswith(f"rov-fmu: {fmu}: ")
    assert err.endswith(" results are not as expected\n")


@pytest.mark.parametrize("fmu", ["videoray_fmu", pytest.param("videoray3_fmu", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("begin", "change", "reason"),
    [
        (
            f"{FOLDER}/tuned.ssv",
            lambda old: re.sub(b'value="[^"]*"', b'value="-5"', old, count=1),
            r"fmi\dSet\w+ failed with status 2 \(discard\); the FMU: fmi\dSet\w+: alpha_u = -5 is not within 0 ",
        ),
        (
            "modelDescription.xml",
            lambda old: re.sub(b'(guid|Token)="[^"]*"', b'\\1="wrong"', old),
            r"Failed to instantiate \w+; the FMU: fmi\dInstantiate\w*: the \w+( token)? wrong is not that ",
        ),
        ("binaries/", lambda _: b"none", "Failed to load shared library binaries"),
    ],
    ids=["out of bounds", "a wrong token", "no library"],
)
def test_the_reason_why_an_fmu_fails_is_given(
    fmu: str, begin: str, change: Change, reason: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    first = prove_fmu(_with(request.getfixturevalue(fmu), {}, tmp_path / "other.fmu", begin, change))[0]
    assert not first.passed
    assert re.match(reason, first.error)
    assert str(Path(tempfile.gettempdir())) not in first.error


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a library that is cut off is not loaded")
def test_an_fmu_that_ends_its_process_is_one_line(videoray_fmu: Path, tmp_path: Path, capsys: Capsys) -> None:
    fmu = _with(videoray_fmu, {}, tmp_path / "cut.fmu", "binaries/", lambda old: old[:20_000])
    assert main(["prove", str(fmu)]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    where = f"rov-fmu: {fmu}: experiment 'surge_70_tuned': the FMU ended its process: "
    assert err in {f"{where}SIGBUS\n", f"{where}SIGSEGV\n"}


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (
            "    def enter_initialization_mode(self):\n        __import__('time').sleep(60.0)\n",
            "experiment 'step': the FMU needs more than 1 s; --time-limit allows more",
        ),
        ("    def setup_experiment(self, *_):\n        self.all = bytearray(5_000_000_000)\n", "not as expected"),
    ],
    ids=["time", "memory"],
)
def test_an_fmu_has_limits_of_time_and_memory(
    code: str, expected: str, foreign: Path, tmp_path: Path, capsys: Capsys
) -> None:
    fmu = _with(foreign, {}, tmp_path / "limited.fmu", "resources/counter.py", lambda old: old + code.encode())
    begun = time.monotonic()
    assert main(["prove", str(fmu), "--time-limit", "1"]) == 1
    assert time.monotonic() - begun < 30.0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(expected)


_HANGS = """
    def do_step(self, current_time, step_size):
        import ctypes, os
        open(os.environ["HANGS"], "w").close()
        mutex = ctypes.create_string_buffer(256)
        while True:  # the second call waits forever for the first one
            ctypes.PyDLL(None).pthread_mutex_lock(mutex)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="signals and mutexes are POSIX")
def test_an_fmu_that_hangs_is_ended_by_ctrl_c(foreign: Path, tmp_path: Path) -> None:
    """It hangs in compiled code, which Python cannot interrupt."""
    from tests.cli.test_interrupts import LINE, Command  # which needs a terminal of POSIX

    fmu, begun = tmp_path / "hangs.fmu", tmp_path / "begun"
    _with(foreign, {}, fmu, "resources/counter.py", lambda old: old + _HANGS.encode())
    with Command(["-m", "rov_fmu", "prove", str(fmu)], tmp_path, environment={"HANGS": str(begun)}) as proof:
        proof.wait_until(begun.exists)
        assert proof.press_ctrl_c() == LINE


# ---- Bad input -------------------------------------------------------------------------------------------------------

_EXP = f"{FOLDER}/my tests/all.exp"
_Y = f"{FOLDER}/my tests/y.csv"


def _exp(inner: str) -> str:
    return f'<Experiments name="x"><Experiment name="a" {inner}</Experiment></Experiments>'


BAD: dict[str, tuple[Files, str]] = {
    "no manifest": ({MANIFEST: None}, f"{MANIFEST}: there is no such file: the FMU carries no reference results"),
    "no XML": ({MANIFEST: "<fmiReferences>"}, f"{MANIFEST}: not XML: "),
    "a tolerance that all meet": (
        {_EXP: _exp('stopTime="1" tolerance="1e300">')},
        f"{_EXP}: experiment 'a': tolerance = 1e+300: must be less than 1, or nothing would be compared",
    ),
    "experiments without end": (
        {_EXP: "<Experiments>" + '<Experiment><References source="y.csv"/></Experiment>' * 1001 + "</Experiments>"},
        f"{MANIFEST}: names 1001 experiments; at most 1000 are run",
    ),
    "time that goes back": ({_Y: "time,y\n1,0\n0,0\n"}, f"{_Y}, line 3: the time goes back"),
    "an unknown parameter": (
        {"k.ssv": '<ParameterSet><Parameter name="q"><Real value="1"/></Parameter></ParameterSet>'},
        f"{FOLDER}/k.ssv: the FMU has no variable 'q'",
    ),
    "a file that is a folder, too": (
        {"modelDescription.xml/": ""},
        "member 'modelDescription.xml': is the path of another member",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_that_names_the_file(case: str, foreign: Path, tmp_path: Path, capsys: Capsys) -> None:
    files, reason = BAD[case]
    fmu = _with(foreign, files, tmp_path / "bad.fmu")
    assert main(["prove", str(fmu)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"rov-fmu: {fmu}: {reason}")
    assert err.count("\n") == 1


def test_what_an_fmu_does_not_have_is_named(foreign: Path, videoray_fmu: Path, tmp_path: Path, capsys: Capsys) -> None:
    assert main(["prove", str(foreign), "--interface", "model-exchange"]) == 2
    assert capsys.readouterr().err == f"rov-fmu: {foreign}: has no model-exchange, only co-simulation\n"
    with zipfile.ZipFile(videoray_fmu) as archive:
        binaries = dict.fromkeys(n for n in archive.namelist() if n.startswith("binaries/"))
    bare = _with(videoray_fmu, binaries, tmp_path / "bare.fmu")
    assert main(["prove", str(bare)]) == 2
    assert capsys.readouterr().err == f"rov-fmu: {bare}: has no binary for this machine ({fmpy.platform}): c-code\n"
