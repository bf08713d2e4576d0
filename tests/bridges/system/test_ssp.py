"""Systems of other tools (SSP 1.0) are read whole, or refused by what is not read."""

from pathlib import Path

import pytest

from rov_fmu.bridges.system.connections import Connection, SystemStructure
from rov_fmu.bridges.system.ssp import read_ssp
from rov_fmu.fmu.archive import archive
from rov_fmu.fmus import fmu
from rov_fmu.fmus.description import described as described_here
from rov_fmu.io.messages import FileError
from tests.bridges.system.fmus import foreign

SET = '<ssv:ParameterSet version="1.0" name="s"><ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet>'
MAPPING = '<ssm:ParameterMapping version="1.0">{}</ssm:ParameterMapping>'
LINEAR = '<ssc:LinearTransformation factor="{}" offset="{}"/>'
STANDARDS = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for prefix, name in (("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"), ("ssm", "Mapping"))
)
WHOLE = f"""<?xml version="1.0"?>
<ssd:SystemStructureDescription {STANDARDS} version="1.0" name="d">
<ssd:System name="s">{{}}</ssd:System><ssd:DefaultExperiment stopTime="1"/></ssd:SystemStructureDescription>"""


def parameters(**values: object) -> str:
    """Return a set of numbers."""
    form = '<ssv:Parameter name="{}"><ssc:Real value="{}"/></ssv:Parameter>'
    return SET.format("".join(form.format(*pair) for pair in values.items()))


def of(name: str, content: str = "", more: str = "") -> str:
    """Return an element of the structure."""
    return f"<ssd:{name} {more}>{content}</ssd:{name}>"


def bound(values: str, mapping: str = "", more: str = "") -> str:
    """Return a binding of parameters, perhaps with a mapping."""
    own = of("ParameterValues", values) + (of("ParameterMapping", mapping) if mapping else "")
    return of("ParameterBindings", of("ParameterBinding", own, more))


def entry(source: str, target: str, factor: float = 1.0, offset: float = 0.0) -> str:
    return f'<ssm:MappingEntry source="{source}" target="{target}">{LINEAR.format(factor, offset)}</ssm:MappingEntry>'


def component(name: str, content: str = "", source: str = "amplifier.fmu") -> str:
    return of("Component", content, f'name="{name}" source="{source}" type="application/x-fmu-sharedlibrary"')


def connectors(**kinds: str) -> str:
    """Return connectors by their names and kinds."""
    words = [f'name="{name}" kind="{kind}"' for name, kind in kinds.items()]
    return of("Connectors", "".join(of("Connector", "<ssc:Real/>", word) for word in words))


def connection(start: str, end: str, content: str = "", more: str = "") -> str:
    """Return a connection of two ends, each `component.variable` or the connector of the system."""
    for key, text in (("start", start), ("end", end)):
        element, _, name = text.rpartition(".")
        more += f' {key}Connector="{name}"' + (f' {key}Element="{element}"' if element else "")
    return of("Connection", content, more)


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(fmu, "read_description", lambda _, folder: described_here(str(folder)))
    return tmp_path / "my.ssp"


def read(path: Path, system: str, **files: str) -> SystemStructure:
    content = {"SystemStructure.ssd": WHOLE.format(system), **files}
    fmus = {"amplifier.fmu": foreign(), "feet.fmu": foreign("ft", m="1", factor="0.3048")}
    path.write_bytes(archive({name: text.encode() for name, text in content.items()} | fmus))
    return read_ssp(path)


A = of("Elements", component("a", bound(parameters(k=1, u=2))))
FROM_FILE = '<ssd:ParameterBinding source="own.ssv"><ssd:ParameterMapping source="own.ssm"/></ssd:ParameterBinding>'
VALUES = {
    "of the component": (A, {"k": 1.0, "u": 2.0}),
    "of the system, which win": (bound(parameters(**{"a.k": 3})) + A, {"k": 3.0, "u": 2.0}),
    "with a prefix": (bound(parameters(k=4), "", 'prefix="a."') + A, {"k": 4.0, "u": 2.0}),
    "with a mapping after the prefix": (
        bound(parameters(k=1), MAPPING.format(entry("p_k", "a.k", 2, 5) + entry("p_k", "a.u", 4, 0)), 'prefix="p_"')
        + A,
        {"k": 7.0, "u": 4.0},
    ),
    "in files of their own": (of("ParameterBindings", FROM_FILE) + A, {"k": 6.0, "u": 2.0}),
    "through the connector of the system": (
        connectors(gain="parameter", way="input")
        + bound(parameters(gain=3, way=5))
        + A
        + of("Connections", connection("a.k", "gain", LINEAR.format(2, 1)) + connection("way", "a.u")),
        {"k": 7.0, "u": 5.0},
    ),
}


@pytest.mark.parametrize("case", VALUES)
def test_parameters_have_the_values_of_the_standard(case: str, path: Path) -> None:
    """Those of the whole take precedence; of each, first the prefix is put before the names, then they are mapped."""
    system, expected = VALUES[case]
    own = {"own.ssv": parameters(g=3), "own.ssm": MAPPING.format(entry("g", "a.k", 2))}
    own = {name: text.replace(" version", f" {STANDARDS} version", 1) for name, text in own.items()}
    assert read(path, system, **own).values == {"a": expected}


def test_systems_in_systems_become_one_whose_connections_are_composed(path: Path) -> None:
    """The standard does not say which end of a connection is written first."""
    inner = of(
        "System",
        connectors(into="input", out="output")
        + of("Elements", component("b"))
        + of("Connections", connection("b.u", "into", LINEAR.format(2, 1)) + connection("out", "b.y")),
        'name="inner"',
    )
    joined = connection("a.y", "inner.into", LINEAR.format(3, 5)) + connection("c.u", "inner.out")
    found = read(path, of("Elements", inner + component("a") + component("c")) + of("Connections", joined))
    assert {*found.parts} == {"a", "inner_b", "c"}
    assert {*found.connections} == {
        Connection(("a", "y"), ("inner_b", "u"), 6.0, 11.0),
        Connection(("inner_b", "y"), ("c", "u"), 1.0, 0.0),
    }


TWO = of("Elements", component("a") + component("b") + component("feet", "", "feet.fmu"))
FIRST = connection("a.y", "b.u")
ROUND = of("System", connectors(p="input", q="output") + of("Connections", connection("p", "q")), 'name="t"')
REFUSED = {
    "an element": (TWO + of("SignalDictionaries"), "line 3: SignalDictionaries in System is not read"),
    "an attribute": (
        TWO + of("Connections", connection("a.y", "b.u", "", 'lag="2"')),
        "line 3: lag = '2' of Connection",
    ),
    "another transformation": (
        TWO + of("Connections", connection("a.y", "b.u", "<ssc:BooleanMappingTransformation/>")),
        "line 3: BooleanMappingTransformation in Connection is not read",
    ),
    "Model Exchange": (
        of("Elements", of("Component", "", 'name="a" source="amplifier.fmu" implementation="ModelExchange"')),
        "line 3: implementation = 'ModelExchange' of Component is not read",
    ),
    "a second source": (
        TWO + of("Connections", FIRST + connection("b.u", "feet.y")),
        "line 3: b.u takes one connection, and has one with a.y",
    ),
    "two inputs": (TWO + of("Connections", connection("a.u", "b.u")), "a.u and b.u: one must be an output"),
    "a connector of nothing": (TWO + of("Connections", connection("a.y", "b.w")), "there is no connector 'b.w'"),
    "a way that goes round": (
        of("Elements", component("a") + ROUND) + of("Connections", connection("t.q", "t.p") + connection("t.q", "a.u")),
        "is connected to itself",
    ),
    "a unit": (
        TWO + of("Connections", connection("a.y", "feet.u", LINEAR.format(2, 0))),
        "is in m, and feet.u in ft",
    ),
    "the unit of a connector": (
        of("Elements", component("a", connectors(u="input").replace("<ssc:Real/>", '<ssc:Real unit="km"/>'))),
        "line 3: a.u is in km, and not in m: no unit is converted",
    ),
    "the unit of a parameter": (
        of("Elements", component("a", bound(parameters(u=1).replace("value", 'unit="km" value')))),
        "line 3: start value of a.u: is in km, and not in m: no unit is converted",
    ),
    "a parameter of nothing": (bound(parameters(**{"a.q": 1})) + A, "there is no parameter or connector 'a.q'"),
    "a mapping of nothing": (
        bound(parameters(k=1), MAPPING.format(entry("q", "a.k"))) + A,
        "line 3: there is no parameter 'q'",
    ),
    "a Boolean that is none": (
        bound(parameters(**{"a.k": 1}).replace('Real value="1"', 'Boolean value="yes"')) + A,
        "line 3: a.k must be a finite number, a Boolean or a text",
    ),
    "a value that cannot be": (
        bound(parameters(**{"a.k": 11})) + A,
        "start value of a.k: must be within 0 ... 10",
    ),
    "no number": (TWO + of("Connections", connection("a.y", "b.u", LINEAR.format("inf", 0))), "must be finite numbers"),
    "no parameters": (of("ParameterBindings", of("ParameterBinding")) + A, "line 3: there is no ParameterSet"),
    "a file of another kind": (
        of("ParameterBindings", of("ParameterBinding", "", 'source="SystemStructure.ssd"')) + A,
        "line 2: must begin with <ParameterSet>",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_read_is_refused_by_file_line_and_name(case: str, path: Path) -> None:
    system, message = REFUSED[case]
    with pytest.raises(FileError) as error:
        read(path, system)
    assert str(error.value).startswith(str(path))
    assert message in str(error.value)


def test_a_connection_may_say_that_units_are_not_converted(path: Path) -> None:
    told = connection("a.y", "feet.u", LINEAR.format(3.28, 0), 'suppressUnitConversion="true"')
    assert read(path, TWO + of("Connections", told)).connections == [Connection(("a", "y"), ("feet", "u"), 3.28, 0.0)]
