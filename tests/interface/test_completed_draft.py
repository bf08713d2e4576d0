"""Completing a rov.toml of any form: what was there stays, what it lacks is added, and a second time nothing is."""

import json
import sys
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rov_fmu.tank.inspection.draft import completed, lacking

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

DRAFT = """# A draft.
base = "bluerov2"

[vehicle]
name = "x"
version = "1.0"

[body]
m_rov = { value = "?", unit = "kg" }   # weigh it

[curves.all]   # the forces of one thruster

[[thruster]]
name = "A"
direction = { value = ["?", "?", "?"] }   # of its thrust

[[thruster]]
name = "B"

[axes.heave]
[axes.yaw]

[columns]  # what headers stand for
"T.1 (us)" = "u_A [us]"
"Tiefe" = "depth [m]"

[dives.dive_1]
files = ["a.csv", "b.csv"]   # of one dive
[dives.dive_2]
files = ["c.csv", "d.csv"]
"""
WHOLE = tomllib.loads(DRAFT)


def value_text(value: Any) -> str:
    """Return a value in one line of TOML."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{json.dumps(key)} = {value_text(one)}' for key, one in value.items())} }}"
    return f"[{', '.join(map(value_text, value))}]" if isinstance(value, list) else json.dumps(value)


def parts_of(name: str, value: Any, form: str) -> list[str]:
    """Return the parts of a file that have a key or a table in one of the forms of TOML; those with headers last."""
    if form == "inline" or not value or not isinstance(value, dict | list):
        return [f"{name} = {value_text(value)}  # mine\n"]
    if isinstance(value, list):
        rows = ["".join(f"{key} = {value_text(one)}\n" for key, one in row.items()) for row in value]
        return ["".join(f"\n[[{name}]]  # mine\n{row}" for row in rows)]
    if form == "dotted":
        return ["".join(f"{name}.{json.dumps(key)} = {value_text(one)}\n" for key, one in value.items())]
    nested = {key: one for key, one in value.items() if form == "headers" and isinstance(one, dict)}
    keys = "".join(
        f"{json.dumps(key)} = {value_text(one)}  # mine\n" for key, one in value.items() if key not in nested
    )
    parts = [f"[{name}]\n{keys}"] if keys else []
    return parts + [
        f"[{name}.{json.dumps(key)}]\n{''.join(f'{k} = {value_text(v)}{chr(10)}' for k, v in one.items())}"
        for key, one in nested.items()
    ]


@st.composite
def own_files(draw: st.DrawFn) -> str:
    """Return a rov.toml with some of the tables and keys of the draft, and with others, in any order and form."""
    parts = []
    for name, value in (WHOLE | {"limits": {"duration": 60.0}}).items():
        if not draw(st.booleans()):
            continue
        mine: Any = value
        if isinstance(value, dict):
            mine = {key: one for key, one in value.items() if draw(st.booleans())}
            mine |= draw(st.sampled_from([{}, {"dive 9": {"files": ["a.csv", "z.csv"]}}] if name == "dives" else [{}]))
        parts += parts_of(name, mine, draw(st.sampled_from(["inline", "dotted", "table", "headers"])))
    parts = draw(st.permutations(parts))
    ordered = sorted(parts, key=lambda part: part.lstrip().startswith("["))
    return draw(st.sampled_from(["", "# Ours.\n\n"])) + draw(st.sampled_from(["", "\n"])).join(ordered) + "# the end"


@given(own_files(), st.booleans())
def test_a_file_of_any_form_is_completed_and_not_damaged(own: str, has_vehicle: bool) -> None:
    before, lacks = tomllib.loads(own), lacking(own, DRAFT, has_vehicle=has_vehicle)
    text = completed(own, lacks)
    after, more = tomllib.loads(text), tomllib.loads(lacks)
    assert after == before | {
        name: before[name] | value if isinstance(value, dict) and name in before else value
        for name, value in more.items()
    }
    assert {*WHOLE["columns"].items()} <= {*after["columns"].items()}, "nothing that is wanted is left out"
    assert text.count("# mine") == own.count("# mine"), "comments stay"
    assert "# the end" in text
    assert not ("base" in before and "thruster" not in before and "thruster" in after), "a base has its own thrusters"
    assert lacking(text, DRAFT, has_vehicle=has_vehicle) == "", "a second time, nothing is lacking"


TOLD = (
    DRAFT.replace('base = "bluerov2"\n', "")
    .replace('m_rov = { value = "?"', "m_rov = { value = 9.0")
    .replace('{ value = ["?", "?", "?"] }   # of its thrust', "{ value = [1, 0, 0] }   # of its thrust; a guess")
)
"""The draft with what later logs tell."""


@given(own_files())
def test_what_is_told_takes_the_place_of_a_question_mark_alone(own: str) -> None:
    """A base that is not decided goes, where the logs tell the thrusters; every comment stays."""
    own = own.replace('"bluerov2"', '"?"')
    before = tomllib.loads(own)
    text = completed(own, lacking(own, TOLD, has_vehicle=False))
    after = tomllib.loads(text)
    assert text.count("# mine") == own.count("# mine")
    if before.get("thruster"):
        assert after["thruster"][0]["direction"] == {"value": [1, 0, 0]}
    if "m_rov" in before.get("body", {}):
        assert after["body"]["m_rov"] == {"value": 9.0, "unit": "kg"}
    assert lacking(text, TOLD, has_vehicle=False) == "", "a second time, nothing is lacking"
    mine = own.replace('"?"', "7.5")
    numbers = tomllib.loads(mine)
    kept = tomllib.loads(completed(mine, lacking(mine, TOLD, has_vehicle=True)))
    assert all(kept[name] == value or kept[name].items() >= value.items() for name, value in numbers.items())


@pytest.mark.parametrize("draft", [DRAFT, TOLD])
@pytest.mark.parametrize(
    "own",
    [
        *("axes = 3", 'columns = "x"\nvehicle = []', "dives.a = 3", "dives = []", "[dives.a]\nfiles = 3"),
        *('thruster = "?"', 'body = "?"', '[curves.all]\nthrust = "?"\nT = 3.0', 'thruster = [3, "A"]'),
    ],
)
def test_a_key_of_a_wrong_type_stays_as_it_is(own: str, draft: str) -> None:
    text = completed(own, lacking(own, draft, has_vehicle=False))
    assert tomllib.loads(own).items() <= tomllib.loads(text).items() or "dives" in own
    assert lacking(text, draft, has_vehicle=False) == ""


def test_thrusters_without_a_name_of_their_own_stay() -> None:
    own = '[[thruster]]\nname = [1]\ndirection = "?"\n'
    after = tomllib.loads(completed(own, lacking(own, TOLD, has_vehicle=False)))
    assert [one["name"] for one in after["thruster"]] == [[1], "A", "B"]


def test_a_comment_that_a_draft_shortens_is_not_said_twice() -> None:
    own = '[body]\nI_r = { value = "?", unit = "kg.m2" }   # a guess will do: 0.02 m2 times m_rov\n'
    draft = '[body]\nI_r = { value = 0.1, unit = "kg.m2" }   # a guess will do\n'
    text = completed(own, lacking(own, draft, has_vehicle=False))
    assert text == own.replace('"?"', "0.1")
