"""Tables, equations, commands and drawings in the pages; `python -m docs.reference` writes them anew.

They follow from the code, and stand in the pages so that these can be read in a checkout, each between its name and an
end, in comments. The drawings are files of their own.
"""

import re
from html import escape
from math import degrees
from pathlib import Path
from typing import Any

import click
from matplotlib.figure import Figure

from docs import compared
from rov_fmu.autopilot.figures import first_holds
from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.system.plan import ComponentTable, SystemPlan
from rov_fmu.cli import _commands
from rov_fmu.equation.catalogue import AXIS, HEAVE, ROLL, SURGE, TUNING, axis_words
from rov_fmu.fmu.terminals import terminals
from rov_fmu.fmu.variables import LOG_CATEGORIES
from rov_fmu.identify.likelihood.kinds import PRIORS
from rov_fmu.identify.verdict import RULES
from rov_fmu.io.toml_file import Strict
from rov_fmu.report.page.equations import equations_of
from rov_fmu.report.page.pictures import diagram
from rov_fmu.report.plots.svg import name_axes, svg_file
from rov_fmu.report.templates import number
from rov_fmu.study.plan import InputFile, InputSignal, Keep, Plan, Varied
from rov_fmu.tank import catalogue
from rov_fmu.tank.readers.ardusub_frames import FRAMES, fitting_frames
from rov_fmu.vehicle.json_schema import json_schema
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from verification.identification.strangers import gates

Table = list[tuple[str, ...]]
_NAMES = (
    *("model.md", "vehicle-file.md", "variables.md", "studies.md", "system.md", "cli.md", "vehicles.md"),
    *("identify-formats.md", "identify-method.md", "identification-benchmark.md", "ardusub.md", "autopilot.md"),
)
PAGES = [Path(__file__).with_name(name) for name in _NAMES]
DRAWN = {name: load_vehicle(SHIPPED[name]) for name in ("videoray", "bluerov2", "bluerov2_heavy")}
"""The vehicles with a drawing. The refit of the VideoRay has the same thrusters."""

_KEYS = ("key", "value", "what")
_TYPES = {"string": "text", "boolean": "true, false", "integer": "whole number", "object": "table", "array": "list"}


def tables() -> dict[str, Table]:
    """By name."""
    schema = json_schema()
    named = {"vehicle": "FileHead", "estimated": "Estimated"}
    named |= {name.lower(): name for name in ("Validity", "Body", "Arm", "Surface")}
    named |= {name.lower(): f"{name}Table" for name in ("Curve", "Thruster", "Fin", "Point", "Battery", "Commands")}
    categories: Table = [("category", "what")]
    categories += ((f"`{name}`", words) for name, words in LOG_CATEGORIES.items())
    found: dict[str, Table] = {"log_categories": categories, "terminals": _terminals()}
    found |= {"axis": _axis(), "columns": _columns(), "messages": _messages(), "priors": _priors(), "frames": _frames()}
    found["holds"] = _holds()
    kept = gates.stages()[-1:]
    by_group = gates.by_kind(kept)[: 1 + len(gates.GROUPS)]
    found |= {"gates": gates.gates(kept), "strangers": [(name, *cells) for name, _, *cells in by_group]}
    found["verdict"] = [("", "*usable*", "*do not use*"), *(rule.row for rule in RULES)]
    plans: dict[str, type[Strict]] = {
        "plan": Plan,
        "varied": Varied,
        "signal": InputSignal,
        "input_file": InputFile,
        "keep": Keep,
        "system": SystemPlan,
        "component": ComponentTable,
    }
    found |= {name: _plan_table(of) for name, of in plans.items()}
    found |= {name: _table(schema["$defs"][of], schema) for name, of in named.items()}
    as_thruster = {row[0] for row in found["thruster"][1:]}
    return found | {"fin": [row for row in found["fin"] if row[0] not in as_thruster]}


def _priors() -> Table:
    """Return the deviations of the priors of an identification, with their keys in rov.toml."""
    rows = ((f"`{key}`", f"{prior.deviation:g}", prior.words, prior.reason) for key, prior in PRIORS.items())
    return [("key", "deviation", "of", "reason"), *rows]


def _frames() -> Table:
    """Return the frames of ArduSub, with the vehicles that ship and fit them."""
    shipped = {name: fitting_frames(load_vehicle(path).layout) for name, path in SHIPPED.items()}
    rows: Table = [("`FRAME_CONFIG`", "frame", "motors", "vehicles that ship")]
    for config, (frame, motors) in enumerate(FRAMES.items()):
        own = ", ".join(f"`{name}`" for name, frames in shipped.items() if frame in frames)
        rows.append((str(config), f"`{frame}`", str(len(motors)), own))
    return rows


def _holds() -> Table:
    """Return the first holds of the vehicles that ship, for the steps of the autopilot that the page promises."""
    steps = (0.01, 0.02, 0.05, 0.1)
    rows: Table = [("vehicle", *(f"{1e3 * step:.0f} ms" for step in steps))]
    for name, path in SHIPPED.items():
        cells = []
        for step in steps:
            words = []
            for axis, (figures, worst) in first_holds(autopilot_of(load_vehicle(path), step)).items():
                factor, unit = (1e2, " cm") if axis is HEAVE else (degrees(1.0), "°")
                over, most = factor * figures.overshoot[0], factor * worst
                words.append(f"{figures.rise[0]:.1f} s, {over:.1f}{unit} ({most:.1f})")
            cells.append("; ".join(words))
        rows.append((f"`{name}`", *cells))
    return rows


def _axis() -> Table:
    """Return the coefficients of an axis, with their units along an axis and about one."""
    words = axis_words(SURGE) | {"axis": "the axis", "velocity": "i", "what": "mass or moment of inertia"}
    words |= {"push": "thrust", "positive": "as its velocity", "negative": "for negative velocities"}
    rows: Table = []
    for key, kind in (AXIS | TUNING).items():
        units = dict.fromkeys(kind.filled(**axis_words(axis)).unit for axis in (SURGE, ROLL))
        value = ", ".join([*(["needed"] if kind.needed else []), " or ".join(units)])
        _add(rows, key, value, kind.filled(**words).description)
    return [_KEYS, *rows]


def _add(rows: Table, key: str, value: str, words: str) -> None:
    """Add a row for a key, or the key to the row before, if it is the same quantity in reverse or along the next axis.

    The symbol of a coefficient and its owner, which the key and the heading say, are left out of its words.
    """
    if re.fullmatch(r"[A-Za-z](_\w+)?", key):
        words = re.sub(rf" {key}(?![\w^)])", "", words, count=1).replace(" of the curve", "")
    words = re.sub(r" (?:of|in) the axis", "", words)
    of_last = rows[-1][0].split("`")[-2] if rows else ""
    of_same = (f"`{key.removesuffix('_reverse')}`", *(f"`{first}{key[1:]}`" for first in "xy"))
    if rows and rows[-1][1] == value.replace("needed, ", "") and (f"`{of_last}`" in of_same and of_last != key):
        keys, _, before = rows[-1]
        place = words.partition(", ")[2]
        rows[-1] = (f"{keys}, `{key}`", value, f"{before}, {place}" if place else before)
    elif rows and key.endswith("_reverse"):
        base = next(n for n, row in enumerate(rows) if row[0] == f"`{key.removesuffix('_reverse')}`")
        rows[base] = (f"{rows[base][0]}, `{key}`", *rows[base][1:])
    else:
        rows.append((f"`{key}`", value, words))


def _columns() -> Table:
    """Return the columns of measurements that a CSV log may have."""
    rows: Table = [("column", "also, with a unit", "units")]
    for name, quantity in catalogue.QUANTITIES.items():
        also, units = (", ".join(f"`{word}`" for word in words) for words in (quantity.also, quantity.units))
        rows.append((f"`{name}`", also, units))
    return rows


def _messages() -> Table:
    """Return the messages that are recognised, by what they measure."""
    words = {catalogue.EULER: "roll, pitch, heading", catalogue.QUATERNION: "roll, pitch, heading"}
    words |= {catalogue.POSITION: "depth, distance", catalogue.VELOCITY: "velocities", catalogue.RATES: "rates of turn"}
    words |= {"heading": words[catalogue.EULER]}
    for vector in (catalogue.VELOCITY, catalogue.RATES):
        words |= dict.fromkeys(catalogue.VECTORS[vector], words[vector])
    found: dict[str, dict[str, None]] = {"commands of thrusters": {}}
    for output in catalogue.OUTPUTS:
        found["commands of thrusters"][f"`{_plain(output.kind)}`"] = None
    for message in catalogue.MESSAGES:
        field = "" if message.gives in words else f".{message.fields[0]}"
        found.setdefault(words.get(message.gives, message.gives), {})[f"`{_plain(message.kind)}{field}`"] = None
    rows = ((name, ", ".join(messages)) for name, messages in found.items())
    return [("measured", "messages, preferred ones first"), *rows]


def _plain(pattern: str) -> str:
    """Return a regular expression for the type of a message as people write it."""
    plain = re.sub(r"\(\w+\)\?|\[\w+\]\?", "", pattern.replace("\\d+", "").replace(".*", ""))
    plain = re.sub(r"\[(\w)\w*\]", r"\1", plain)
    return re.sub(r"\((\w+)\|\w+\)", r"\1", plain)


def markdown(table: Table) -> str:
    """As a page has it: the first row has the headings."""
    heads, *rows = (f"| {' | '.join(row)} |" for row in table)
    return "\n".join([heads, f"|{'---|' * len(table[0])}", *rows])


def filled(page: str) -> str:
    """The text of a page with what is generated in it as it is to be."""
    found = tables()

    def text(match: re.Match[str]) -> str:
        kind, name = match[2], match[3]
        if kind == "commands":
            content = _command_reference()
        elif kind == "drawings":
            content = _gallery()
        elif kind == "equations":
            content = f"```text\n{_equations(name)}\n```"
        else:
            content = markdown(found[name] if name in found else compared.tables()[name])
        return f"{match[1]}\n\n{content}\n\n"

    return re.sub(
        r"(<!-- (commands|drawings|equations|table)(?:: (\w+))? -->)\n.*?(?=<!-- end -->)",
        text,
        page,
        flags=re.DOTALL,
    )


def elements(drawing: str) -> list[tuple[str, str]]:
    """The elements and texts of a drawing, which do not depend on the version of Matplotlib as its numbers do."""
    return re.findall(r"<(\w+)|>([^<>]+)<", drawing)


def drawings() -> dict[Path, str]:
    """The drawings of the vehicles, those of the FMU's diagram, and of a current that changes, by their paths."""
    drawn = {name: diagram(one) for name, one in DRAWN.items()}
    drawn["current"] = svg_file(_current, (6.0, 2.6), salt="current")
    return {Path(__file__).with_name("drawings") / f"{name}.svg": drawing for name, drawing in drawn.items()}


def _current(figure: Figure) -> None:
    """Draw the place north of a Heavy at rest, from when the current becomes 0.5 m/s, under three conventions."""
    rov, ax = DRAWN["bluerov2_heavy"], figure.add_subplot()
    kept = rov["m_rov"] / (rov["m_rov"] + rov["m_a_u"])
    for words, share in (("carried: ν_r stays", 0.0), ("M_RB ν + M_A ν_r stays", kept), ("passes: ν stays", 1.0)):
        state, north = rov.step(rov.layout.usual_inputs, rov.layout.at_rest, 5.0), [0.0]
        state["u"] -= 0.5 * share
        for _ in range(10):
            state = rov.step(rov.layout.usual_inputs | {"V_N": 0.5}, state, 0.5)
            north.append(state["x"])
        ax.plot([5.0 + 0.5 * n for n in range(11)], north, label=f"{words}, {north[-1]:.4f} m")
    ax.legend()
    name_axes(ax, "north", "m", "time [s]")


def _gallery() -> str:
    """The drawings, as the page of the vehicles has them."""
    one = "**{0}**\n\n![Thrusters and axes of the {0}](drawings/{1}.svg)"
    return "\n\n".join(one.format(vehicle.name, name) for name, vehicle in DRAWN.items())


def _command_reference() -> str:
    """Every command with its arguments and its first sentence; --help prints the options."""
    root, rows = click.Context(_commands, info_name="rov-fmu"), []
    for name in _commands.list_commands(root):
        command = _commands.commands[name]
        with click.Context(command, root, name) as context:
            usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
        rows.append((f"`{usage}`", escape(command.get_short_help_str(limit=1000), quote=False)))
    return markdown([("command", "what it does"), *rows])


def _equations(name: str) -> str:
    """The equations of a vehicle that ships, a line for each term, with what it is behind."""
    rows = [row for line in equations_of(load_vehicle(SHIPPED[name]).layout) for row in line.rows()]
    return "\n".join(f"{left:>11} {term:<60} {words}" for left, term, words in rows)


def _terminals() -> Table:
    """A row a terminal of the VideoRay, which has them all."""
    rows = [
        (
            f"`{terminal.name}`",
            terminal.causality,
            terminal.rule,
            terminal.description,
            ", ".join(f"`{name}`" for name in terminal.variables),
        )
        for terminal in terminals(load_vehicle(VIDEORAY).layout)
    ]
    return [("terminal", "of", "matching", "what", "members in the VideoRay"), *rows]


def _table(table: dict[str, Any], schema: dict[str, Any]) -> Table:
    """A row a key; keys of one quantity share a row. The schema has the range of a quantity."""
    rows: Table = []
    for key, entry in table["properties"].items():
        found = _resolved(entry, schema)
        of_value = found.get("properties", {}).get("value")
        unit = found["properties"].get("unit", {}).get("const", "") if of_value else ""
        needed = "needed" if key in table.get("required", ()) else ""
        allowed = "" if unit and "minimum" in of_value else _allowed(of_value or found)
        value = ", ".join(filter(None, (needed, unit, allowed)))
        _add(rows, key, value, _words(found))
    return [_KEYS, *rows]


def _plan_table(of: type[Strict]) -> Table:
    """A row a key of a plan of a study, or of a table in it."""
    schema, rows = json_schema(of), []
    for (key, entry), field in zip(schema["properties"].items(), of.model_fields.values(), strict=True):
        found = _resolved(entry, schema)
        keys = ", ".join(f"{inner} = ..." for inner in found.get("properties", ()))
        parts = ["needed"] if field.is_required() else []
        parts.append(f"`{{ {keys} }}`" if keys else _allowed(found))
        parts += (
            [f"default `{field.default}`"] if field.default not in (None, {}, ()) and not field.is_required() else []
        )
        rows.append((f"`{key}`", ", ".join(parts), _words(found)))
    return [_KEYS, *rows]


def _resolved(entry: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = schema["$defs"][entry["$ref"].removeprefix("#/$defs/")] if "$ref" in entry else entry
    return found


def _words(entry: dict[str, Any]) -> str:
    return _escaped(str(entry.get("description", "")))


def _escaped(text: str) -> str:
    """A text that fits into a cell of a table."""
    return " ".join(text.split("\n")).replace("|", r"\|")


def _allowed(entry: dict[str, Any]) -> str:
    if "minimum" in entry and "maximum" in entry:
        return f"{number(entry['minimum'], 6)}\xa0…\xa0{number(entry['maximum'], 6)}"
    if choices := entry.get("enum", [entry["const"]] if "const" in entry else []):
        return ", ".join(f"`{choice}`" for choice in choices)
    if "exclusiveMinimum" in entry:
        most = f", at most {number(entry['maximum'], 6)}" if "maximum" in entry else ""
        return f"more than {number(entry['exclusiveMinimum'], 6)}{most}"
    if entry.get("minItems") == entry.get("maxItems", 0):
        return f"{entry['minItems']} numbers"
    return _TYPES.get(entry.get("type", ""), "number")


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
    for path, drawing in drawings().items():
        if not path.exists() or elements(path.read_text(encoding="utf-8")) != elements(drawing):
            path.write_text(drawing, encoding="utf-8")
