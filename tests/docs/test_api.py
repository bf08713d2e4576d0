"""The public functions of docs/api-in-full.rst: each argument is described, and each has an example that runs."""

import re
import shutil
from collections.abc import Callable, Iterator
from importlib import import_module
from inspect import getdoc, isfunction, signature
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest

import rov_fmu
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE, ROOT

_PLAN = """
vehicle = "videoray"
stop_time = 1.0
step = 0.1
runs = 2
vary = { health_l.uniform = [0.5, 1.0] }
figures = { u = "final(u)" }
"""


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """The functions and methods of the site's page. Those of the identification have examples in the tutorials."""
    page = (ROOT / "docs" / "api-in-full.rst").read_text(encoding="utf-8")
    for path, members in re.findall(r"auto\w+:: (\S+)(?:\n +:members: (.*))?", page):
        module, _, name = path.rpartition(".")
        owner = getattr(import_module(module), name)
        for own in members.split(", ") if members else [""]:
            value = getattr(owner, own) if own else owner
            if isfunction(value) and not value.__module__.startswith("rov_fmu.identify"):
                yield f"{path}.{own}".rstrip("."), value
    # `rov_fmu.load` and others return this class, whose functions take the names of axes, too
    for own in ("step", "derivatives", "response"):
        yield f"VehicleModel.{own}", getattr(rov_fmu.load("videoray").__class__, own)


PUBLIC = dict(public())


def test_what_is_documented_is_what_is_public() -> None:
    page = (ROOT / "docs" / "api-in-full.rst").read_text(encoding="utf-8")
    assert sorted(re.findall(r"auto\w+:: rov_fmu\.(?:[\w.]+\.)?(\w+)$", page, re.MULTILINE)) == sorted(rov_fmu.__all__)
    assert page.count(".. auto") == len(rov_fmu.__all__)


def said(function: Callable[..., Any]) -> tuple[list[str], list[str]]:
    """The arguments that a docstring describes, and its examples."""
    text = getdoc(function) or ""
    listed = re.findall(r"^- ((?:`\w+`(?:, )?)+):", text, re.MULTILINE)
    examples = re.findall(r"(?:^|\n\n)((?: {4}[^\n]*\n?)+)", text)
    return [name for names in listed for name in re.findall(r"\w+", names)], [dedent(one) for one in examples]


@pytest.mark.parametrize("name", PUBLIC)
def test_each_argument_is_described_and_there_is_an_example(name: str) -> None:
    function = PUBLIC[name]
    described, examples = said(function)
    arguments = {argument for argument in signature(function).parameters if argument != "self"}
    refers = "arguments, the result" in (getdoc(function) or "") or "arguments are those of" in (getdoc(function) or "")
    assert arguments == {*described} or (refers and not described), name
    assert examples, name


@pytest.mark.long
def test_the_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They run in the order of the page, in one folder: one builds the FMU that the next one proves."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(BARE, "bare.toml")
    Path("plan.toml").write_text(_PLAN, encoding="utf-8")
    names: dict[str, Any] = {name: getattr(rov_fmu, name) for name in rov_fmu.__all__}
    names |= {"rov_fmu": rov_fmu, "np": np, "Path": Path, "HEAVE": HEAVE}
    for name, function in PUBLIC.items():
        if function.__module__.endswith(("identify_command", "inspect_command")):
            continue  # what the tutorials run
        usual = load_vehicle(SHIPPED["videoray"]) if "Vehicle." in name else rov_fmu.load("videoray")
        own = {**names, "rov": usual}
        for example in said(function)[1]:
            exec(compile(example, name, "exec"), own)
    assert isinstance(usual, Vehicle)
    assert {path.name for path in tmp_path.iterdir()} >= {"videoray.fmu", "fouled.fmu", "run.csv", "run.png", "results"}
