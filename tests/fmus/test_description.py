"""The model description of an FMU from an unknown source is read by FMPy in a child process, or refused in one line."""

import re
from pathlib import Path

import pytest

from rov_fmu.fmus.description import described, read_description
from rov_fmu.io.messages import FileError

_VARIABLES = """<ModelVariables>
  <ScalarVariable name="p" valueReference="1" causality="parameter" variability="fixed">
    <Real start="NaN" min="-INF" nominal="2"/></ScalarVariable>
  <ScalarVariable name="y" valueReference="2" causality="output"><Real derivative="1"/></ScalarVariable>
</ModelVariables>"""
_OF_2 = f"""<fmiModelDescription fmiVersion="2.0" modelName="a" guid="a" generationDateAndTime="today">
<CoSimulation modelIdentifier="a"/><DefaultExperiment stepSize="0.1"/>
<VendorAnnotations><Tool name="t"><Real nominal="x" valueReference="-1"/></Tool></VendorAnnotations>{_VARIABLES}
<ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure></fmiModelDescription>"""
_OF_3 = """<fmiModelDescription fmiVersion="3.0" modelName="a" instantiationToken="a">
<CoSimulation modelIdentifier="a"/><ModelVariables>
<UInt64 name="n" valueReference="0" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="x" valueReference="7" start="1 2"><Dimension valueReference="0"/></Float64>
<Int8 name="i" valueReference="9" variability="discrete" start="5"/></ModelVariables>
<ModelStructure><Output valueReference="7" dependencies="9"/></ModelStructure></fmiModelDescription>"""
_MANY = "".join(f'<ScalarVariable name="v{n}" valueReference="{n}"><Real/></ScalarVariable>' for n in range(100_001))
WRONG: list[tuple[str, str, str, str]] = [
    (_OF_2, 'nominal="2"', 'nominal="INF"', "line 5: nominal = 'INF': must be a finite number"),
    (_OF_2, 'derivative="1"', 'derivative="3"', "The derivative attribute of model variable y (line 6) references"),
    (_OF_2, 'name="y"', 'name="p"', "name = 'p': 2 variables have this name"),
    (_OF_2, '"-INF"', '"NaN"', "line 5: min = 'NaN': must be a finite number"),
    (_OF_2, _VARIABLES, f"<ModelVariables>{_MANY}</ModelVariables>", "has more than 100000 variables, the most"),
    (_OF_2, "<fmi", '<!DOCTYPE a [<!ENTITY b "c">]><fmi', "has a document type definition (DTD); no model description"),
    (_OF_2, "fmiModelDescription", "a", "line 1: Element 'a': No matching global declaration available for"),
    (_OF_2, "<CoSimulation", "<CoSimulation <", "not XML: error parsing attribute name, line 2, column 15"),
    (_OF_3, '"1 2"', '"1 b"', "line 4: Element 'Float64', attribute 'start': 'b' is not a valid value"),
    (
        _OF_2,
        "<DefaultExperiment ",
        '<UnitDefinitions><Unit name="U"><BaseUnit kg="1001"/></Unit></UnitDefinitions><DefaultExperiment ',
        "line 2: kg = '1001': must be a number from -1000 to 1000",
    ),
    (
        _OF_2,
        'modelName="a"',
        'modelName="a" numberOfEventIndicators="100001"',
        "line 1: numberOfEventIndicators = '100001': must be a number from -100000 to 100000",
    ),
    (
        _OF_3,
        '<Dimension valueReference="0"/>',
        '<Dimension valueReference="0"/><Alias name="n"/>',
        'The variable name "n" (line 4) is not unique.',
    ),
    (_OF_3, 's="9"', 's="8"', "names a variable or a unit that does not exist: 8"),
    *(
        (of, 'modelIdentifier="a"', f'modelIdentifier="{name}"', f"modelIdentifier = {name!r}: must be a name without")
        for of in (_OF_2, _OF_3)
        for name in ("../a", "a/b", "..\\a", "C:a", "/a", "")
    ),
    (
        _OF_2,
        'guid="a"',
        'guid="a" more="is not allowed." fmiVersion="2.0"',
        "not XML: Attribute fmiVersion redefined, line 1",
    ),
    (
        _OF_2,
        '"0.1"',
        '"is not allowed."',
        "line 2: Element 'DefaultExperiment', attribute 'stepSize': 'is not allowed",
    ),
]


def _written(folder: Path, text: str) -> Path:
    """Write a model description into a folder."""
    folder.mkdir(exist_ok=True)
    (folder / "modelDescription.xml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(("text", "old", "new", "reason"), WRONG, ids=[row[3] for row in WRONG])
def test_a_wrong_attribute_is_refused(text: str, old: str, new: str, reason: str, tmp_path: Path) -> None:
    assert old in text
    with pytest.raises(Exception, match=f"^{re.escape(reason)}"):
        described(str(_written(tmp_path, text.replace(old, new))))


HARMLESS = (
    (_OF_2, 'guid="a"', 'guid="a" vendor="b"'),
    (_OF_2, 'causality="output"', 'causality="output" initial="calculated"'),
    (_OF_2, '<Real derivative="1"/>', '<Real unit="m" derivative="1"/>'),
    (_OF_2, '<Real derivative="1"/>', "<Integer/>"),
    (_OF_2, 'causality="output"', 'causality="input"'),
)


@pytest.mark.parametrize(("text", "old", "new"), [(_OF_3, "", ""), *HARMLESS])
def test_what_nothing_depends_on_may_be_wrong(text: str, old: str, new: str, tmp_path: Path) -> None:
    """Such as a date that is none, an attribute of a vendor, a missing start value, or a unit that is not defined."""
    assert len(described(str(_written(tmp_path, text.replace(old, new)))).modelVariables) >= 2


def test_a_description_is_read_in_another_process_and_refused_in_one_line(tmp_path: Path) -> None:
    right = read_description(Path("a.fmu"), _written(tmp_path, _OF_2))
    assert [(v.name, v.start, v.min) for v in right.modelVariables] == [("p", "NaN", "-INF"), ("y", None, None)]
    for text, old, new, reason in (WRONG[2], WRONG[14]):
        with pytest.raises(FileError) as error:
            read_description(Path("a.fmu"), _written(tmp_path, text.replace(old, new)))
        assert str(error.value).startswith(f"a.fmu: modelDescription.xml: {reason}")
        assert "\n" not in str(error.value)
    with pytest.raises(FileError, match=r"^a\.fmu: modelDescription\.xml: there is no such file in the FMU$"):
        read_description(Path("a.fmu"), tmp_path / "none")
    _written(tmp_path, f"<a>{' ' * 39_999_994}</a>")
    with pytest.raises(FileError, match=r"modelDescription\.xml has 40,000,001 bytes; at most 40,000,000 are read$"):
        read_description(Path("a.fmu"), tmp_path)
