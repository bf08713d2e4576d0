"""Reading the experiments in an FMU: defaults, limits and mistakes (rov_fmu/prove/experiments.py)."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rov_fmu.fmu.archive import FOLDER, MANIFEST
from rov_fmu.io.messages import FileError
from rov_fmu.prove.experiments import Experiment, read_experiments

_ROWS = "time,y\n0,0\n1,1\n"
_MANIFEST = """<fmiReferences><Related source="a.exp" role="experiment"/>
<Related source="b.exp" role="experiment/uncertainty-analysis"/>
<Related source="c.txt" role="document"/></fmiReferences>"""
_REFERENCES = '<References source="y.csv"/>'


def read(
    tmp_path: Path, attributes: str = "", inside: str = _REFERENCES, y: bytes = _ROWS.encode(), **default: Any
) -> list[Experiment]:
    """Read an FMU with one experiment. `default` is the default experiment of its model description."""
    files = {
        MANIFEST: _MANIFEST,
        f"{FOLDER}/a.exp": f'<Experiments><Experiment name="a" {attributes}>{inside}</Experiment></Experiments>',
        f"{FOLDER}/no.ssv": '<ParameterSet><Parameter name="k"/></ParameterSet>',
    }
    for unit, value in (("m", "2"), ("kg", "2"), ("", "many")):
        text = f'<ParameterSet><Parameter name="k"><Real value="{value}" unit="{unit}"/></Parameter></ParameterSet>'
        files[f"{FOLDER}/{unit or 'word'}.ssv"] = text.replace(' unit=""', "")
    (tmp_path / FOLDER).mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    (tmp_path / FOLDER / "y.csv").write_bytes(y)
    kinds = {"y": "Real", "k": "Real", "vector": "Real", "word": "String"}
    variables = [
        SimpleNamespace(name=name, type=kind, unit="m", dimensions=[3] if name == "vector" else [])
        for name, kind in kinds.items()
    ]
    description = SimpleNamespace(
        modelVariables=variables, defaultExperiment=SimpleNamespace(**default) if default else None
    )
    return read_experiments(Path("one.fmu"), tmp_path, description)


def times(of: list[Experiment]) -> tuple[float, float, float, float]:
    (experiment,) = of
    return experiment.start, experiment.stop, experiment.step, experiment.tolerance


def test_an_experiment_without_times_takes_a_second_in_500_steps(tmp_path: Path) -> None:
    assert times(read(tmp_path)) == (0.0, 1.0, 0.002, 1e-3)
    assert times(read(tmp_path, 'startTime="3"')) == (3.0, 4.0, 0.002, 1e-3)


def test_the_times_of_the_fmu_come_before_the_defaults_and_after_those_of_the_experiment(tmp_path: Path) -> None:
    default: dict[str, Any] = {"startTime": "1", "stopTime": "5", "stepSize": "0.5", "tolerance": "1e-5"}
    assert times(read(tmp_path, **default)) == (1.0, 5.0, 0.5, 1e-5)
    own = 'startTime="2" stopTime="3" stepSize="0.25" tolerance="1e-6"'
    assert times(read(tmp_path, own, **default)) == (2.0, 3.0, 0.25, 1e-6)
    child = f'<TransientSimulation stopTime="9"/>{_REFERENCES}'
    assert times(read(tmp_path, own, child, **default)) == (2.0, 9.0, 0.25, 1e-6)


def test_parameters_and_references_are_read(tmp_path: Path) -> None:
    (experiment,) = read(tmp_path, inside=f'<!-- a word --><Parameters source="m.ssv"/>{_REFERENCES}<Annotations/>')
    assert (experiment.name, experiment.parameters, experiment.stimuli) == ("a", {"k": "2"}, None)
    assert experiment.references is not None
    assert {name: [*values] for name, values in experiment.references.items()} == {"time": [0.0, 1.0], "y": [0.0, 1.0]}


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (
            {"attributes": 'stopTime="0"'},
            "a.exp: experiment 'a': must go on from its start, in steps, with a tolerance",
        ),
        ({"attributes": 'tolerance="0"'}, "a.exp: experiment 'a': must go on from its start"),
        ({"y": bytes(20_000_001)}, "y.csv: has 20,000,001 bytes; at most 20,000,000 are read"),
        ({"y": b"time,word\n0,1\n"}, "y.csv, line 1, column 'word': the variable is not a single number"),
        ({"inside": f"{_REFERENCES}<Zeal/><Other/>"}, "a.exp: experiment 'a': Other, Zeal cannot be run"),
        ({"inside": '<Parameters source="kg.ssv"/>'}, "kg.ssv: parameter 'k': is in kg, and not in m"),
        ({"inside": '<Parameters source="no.ssv"/>'}, "no.ssv: parameter 'k': has no value"),
        ({"inside": '<Parameters source="word.ssv"/>'}, "word.ssv: parameter 'k' = 'many': must be a finite number"),
        ({"inside": '<Parameters source="a.exp"/>'}, "a.exp: must begin with <ParameterSet>, and not with <Experim"),
        ({"inside": '<References source="gone.csv"/>'}, "gone.csv: there is no such file in the FMU"),
        ({"inside": '<References source="/y.csv"/>'}, "a.exp: source = '/y.csv' does not lead to a file in the FMU"),
        ({"inside": '<References source="//[y"/>'}, "a.exp: source = '//[y' does not lead to a file"),
        ({"inside": '<References source="../../../y"/>'}, "a.exp: source = '../../../y' does not lead to a file"),
        ({"inside": ""}, "fmi-ls-manifest.xml: names no experiment with expected results"),
        ({"y": b"time,y\n0,\xff\n"}, "y.csv: is not UTF-8 text, at byte 9"),
        ({"y": b"time,z\n0,1\n"}, "y.csv, line 1, column 'z': the FMU has no such variable"),
    ],
)
def test_a_mistake_is_one_line(given: dict[str, Any], reason: str, tmp_path: Path) -> None:
    with pytest.raises(FileError) as caught:
        read(tmp_path, **given)
    path = "extra/org.fmi-standard.fmi-ls-ref/"
    assert str(caught.value).startswith(f"one.fmu: {path}{reason}")
