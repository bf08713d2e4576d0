"""An FMU from an unknown source is unpacked into its folder, within limits, or refused in one line."""

import stat
import struct
import time
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rov_fmu.cli import main
from rov_fmu.fmu.unpacking import refusal, unpack_fmu
from rov_fmu.io.messages import FileError

_LINK = (stat.S_IFLNK | 0o777) << 16
_STUDY = 'fmu = "bad.fmu"\nstop_time = 1.0\nstep = 0.1\nsampler = "grid"\n[figures]\nend = "u[-1]"\n'


def _member(name: str, content: bytes = b"", mode: int = 0, method: int = zipfile.ZIP_DEFLATED) -> Callable[..., None]:
    def add(archive: zipfile.ZipFile) -> None:
        entry = zipfile.ZipInfo(name)
        entry.create_system, entry.external_attr = 3, mode
        archive.writestr(entry, content, method)

    return add


def _zeros(megabytes: int) -> Callable[..., None]:
    def add(archive: zipfile.ZipFile) -> None:
        entry = zipfile.ZipInfo("resources/zeros.bin")
        entry.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(entry, "w") as file:
            for _ in range(megabytes):
                file.write(bytes(1_000_000))

    return add


BAD: dict[str, tuple[Callable[..., None], str]] = {
    "a path upwards": (_member("resources/../../evil"), "member 'resources/../../evil': a path in an FMU must"),
    "an absolute path": (_member("/tmp/evil"), "member '/tmp/evil': a path in an FMU must be relative"),
    "a path of Windows": (_member("..\\evil"), r"member '..\\evil': a path in an FMU must be relative"),
    "a drive": (_member("C:/evil"), "member 'C:/evil': a path in an FMU must be relative"),
    "a link": (_member("resources/link", b"/etc/passwd", _LINK), "member 'resources/link': is a link or a special"),
    "another compression": (
        _member("resources/a", bytes(1_000_000), method=zipfile.ZIP_BZIP2),
        "member 'resources/a': must be stored or deflated, the compression that FMI allows",
    ),
    "a name that is too long": (_member("x" * 300), "cannot be unpacked: File name too long: xxx"),
    "a file below a file": (_member("modelDescription.xml/x"), "cannot be unpacked: "),
    "a bomb": (_zeros(150), "would take 15"),
}


def _archive(*members: Callable[..., None]) -> BytesIO:
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for add in members:
            add(archive)
    return content


@pytest.mark.parametrize("case", BAD)
def test_a_bad_archive_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    add, message = BAD[case]
    with pytest.raises(FileError) as error:
        unpack_fmu(_archive(_member("modelDescription.xml", _OF_2.encode()), add), Path("a.fmu"), tmp_path / "unpacked")
    assert str(error.value).startswith(f"a.fmu: {message}")
    assert "\n" not in str(error.value)
    assert {file.name for file in tmp_path.iterdir()} <= {"unpacked"}


def test_prove_and_study_refuse_it_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    add, message = BAD["a path upwards"]
    (tmp_path / "bad.fmu").write_bytes(_archive(add).getvalue())
    (tmp_path / "plan.toml").write_text(_STUDY)
    for command in (["prove", "bad.fmu", "--report", "a.html"], ["study", "plan.toml", "-o", "results"]):
        assert main([command[0], *(str(tmp_path / one) if "." in one else one for one in command[1:])]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert err.startswith(f"rov-fmu: {tmp_path / 'bad.fmu'}: {message}")


GB, MB = 10**9, 10**6


@pytest.mark.parametrize(
    ("most", "packed", "said"),
    [
        (2 * GB, GB, "would take 2 GB unpacked; at most 2 GB are allowed"),
        (100 * MB, 1, "would take 100 MB unpacked, 100000001 times the size of the archive; above 100 MB at most 100 "),
        (200 * MB, 2 * MB, "would take 200 MB unpacked, 100 times the size of the archive; above 100 MB at most 100 "),
    ],
)
def test_an_archive_may_unpack_to_so_many_bytes(most: int, packed: int, said: str) -> None:
    for size in (most, most + 1):
        member = zipfile.ZipInfo("a")
        member.file_size = size
        archive: Any = SimpleNamespace(infolist=lambda member=member: [member], start_dir=packed)
        reason = refusal(archive)
        assert reason[: len(said)] == (said if size > most else "")


def test_an_archive_that_claims_to_be_huge_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """The archive declares 3 GB, and nothing is written."""
    content = bytearray(_archive(_member("modelDescription.xml", b"a" * 100, method=zipfile.ZIP_STORED)).getvalue())
    size = content.rindex(b"PK\x01\x02") + 24
    struct.pack_into("<I", content, size, 3_000_000_000)
    start = time.perf_counter()
    with pytest.raises(FileError, match=r"^a\.fmu: would take 3 GB unpacked; at most 2 GB are allowed$"):
        unpack_fmu(BytesIO(content), Path("a.fmu"), tmp_path)
    assert time.perf_counter() - start < 5.0
    assert list(tmp_path.iterdir()) == []


def test_an_archive_that_declares_too_small_a_size_is_not_unpacked_beyond_it(tmp_path: Path) -> None:
    content = bytearray(_archive(_zeros(20)).getvalue())
    for sign, place in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        struct.pack_into("<I", content, content.rindex(sign) + place, 1000)
    with pytest.raises(FileError, match=r"^a\.fmu: is not an FMU, or is damaged: Bad CRC-32"):
        unpack_fmu(BytesIO(content), Path("a.fmu"), tmp_path)
    assert sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file()) <= 1000


def test_an_archive_without_a_description_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"^a\.fmu: is not an FMU that FMPy can read: .*modelDescription.xml"):
        unpack_fmu(_archive(_member("resources/a")), Path("a.fmu"), tmp_path)


_VARIABLES = """<ModelVariables>
  <ScalarVariable name="p" valueReference="1" causality="parameter" variability="fixed">
    <Real start="NaN" min="-INF" nominal="2"/></ScalarVariable>
  <ScalarVariable name="y" valueReference="2" causality="output"><Real derivative="1"/></ScalarVariable>
</ModelVariables>"""
_OF_2 = f"""<fmiModelDescription fmiVersion="2.0" modelName="a" guid="a" generationDateAndTime="today">
<CoSimulation modelIdentifier="a"/><DefaultExperiment stepSize="0.1"/>{_VARIABLES}
<VendorAnnotations><Tool name="t"><Real nominal="x" valueReference="-1"/></Tool></VendorAnnotations>
<ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure></fmiModelDescription>"""
_OF_3 = """<fmiModelDescription fmiVersion="3.0" modelName="a" instantiationToken="a">
<CoSimulation modelIdentifier="a"/><ModelVariables>
<UInt64 name="n" valueReference="0" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="x" valueReference="7" start="1 2"><Dimension valueReference="0"/></Float64>
<Int8 name="i" valueReference="9" variability="discrete" start="5"/></ModelVariables>
<ModelStructure><Output valueReference="7" dependencies="9"/></ModelStructure></fmiModelDescription>"""
_MANY = "".join(f'<ScalarVariable name="v{n}" valueReference="{n}"><Real/></ScalarVariable>' for n in range(100_001))
WRONG: list[tuple[str, str, str, str]] = [
    (_OF_2, 'nominal="2"', 'nominal="INF"', "variable 'p': nominal = 'INF': must be a finite number"),
    (_OF_2, 'ce="2"', 'ce="-1"', "variable 'y': valueReference = '-1': must be a whole number from 0 to 4294967295"),
    (_OF_2, ' valueReference="2"', "", "variable 'y': valueReference is missing"),
    (_OF_2, 'derivative="1"', 'derivative="3"', "variable 'y': derivative: 3: must be an index from 1 to 2"),
    (_OF_2, 'dependencies=""', 'dependencies="1 x"', "Unknown: dependencies = 'x': must be a whole number"),
    (_OF_2, 'name="y"', 'name="p"', "variable 'p': name = 'p': another variable has this name"),
    (_OF_2, '"-INF"', '"NaN"', "variable 'p': min = 'NaN': must be a finite number"),
    (_OF_2, '"output"', '"outputs"', "variable 'y': causality = 'outputs': must be one of parameter, calculated"),
    (_OF_2, '<Real derivative="1"/>', "", "variable 'y': must contain one of Real, Integer, Boolean, String, Enum"),
    (_OF_2, '"0.1"', '"soon"', "DefaultExperiment: stepSize = 'soon': must be a finite number"),
    (_OF_2, _VARIABLES, f"<ModelVariables>{_MANY}</ModelVariables>", "has more than 100000 variables, the most"),
    (_OF_2, "<fmi", '<!DOCTYPE a [<!ENTITY b "c">]><fmi', "defines the entity 'b'; no model description needs"),
    (_OF_2, "fmiModelDescription", "a", "must begin with <fmiModelDescription>, and not with <a>"),
    (_OF_2, "<CoSimulation", "<CoSimulation <", "not XML: error parsing attribute name, line 2, column 15"),
    (_OF_3, '"1 2"', '"1 b"', "variable 'x': start = 'b': must be a finite number"),
    (_OF_2, '<Real derivative="1"/>', '<Boolean start="yes"/>', "variable 'y': start = 'yes': must be true or false"),
    (
        _OF_2,
        '<Real derivative="1"/>',
        '<Integer max="-2147483649"/>',
        "variable 'y': max = '-2147483649': must be a whole number from -2147483648 to 2147483647",
    ),
    (
        _OF_3,
        'start="2"',
        'start="-1"',
        "variable 'n': start = '-1': must be a whole number from 0 to 18446744073709551615",
    ),
    (
        _OF_3,
        "<Dimension ",
        '<Dimension start="-1" ',
        "variable 'x': start = '-1': must be a whole number from 0 to 18446744073709551615",
    ),
    (
        _OF_2,
        "<CoSimulation ",
        '<UnitDefinitions><Unit name="U"><BaseUnit kg="1001"/></Unit></UnitDefinitions><CoSimulation ',
        "BaseUnit: kg = '1001': must be a whole number from -1000 to 1000",
    ),
    (
        _OF_2,
        'modelName="a"',
        'modelName="a" numberOfEventIndicators="100001"',
        "fmiModelDescription: numberOfEventIndicators = '100001': must be a whole number from 0 to 100000",
    ),
    (
        _OF_3,
        '"1 2">',
        '"1 2"><Alias name="n"/>',
        "variable 'x': name = 'n': another variable has this name",
    ),
    (_OF_3, '"5"', '"128"', "variable 'i': start = '128': must be a whole number from -128 to 127"),
    (_OF_3, 's="9"', 's="8"', "Output: dependencies: 8: must be the value reference of a variable"),
]


@pytest.mark.parametrize(("text", "old", "new", "reason"), WRONG, ids=[row[3] for row in WRONG])
def test_a_wrong_attribute_is_one_line(text: str, old: str, new: str, reason: str, tmp_path: Path) -> None:
    folder = _member("resources/", mode=(stat.S_IFDIR | 0o755) << 16)
    right, wrong = (
        _archive(folder, _member("modelDescription.xml", t.encode())) for t in (text, text.replace(old, new))
    )
    assert len(unpack_fmu(right, Path("a.fmu"), tmp_path / "right").modelVariables) >= 2
    with pytest.raises(FileError) as error:
        unpack_fmu(wrong, Path("a.fmu"), tmp_path / "wrong")
    assert str(error.value).startswith(f"a.fmu: modelDescription.xml: {reason}")
