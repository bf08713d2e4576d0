"""The table of gates: counts of what was said of many folders, a row for each stage of the product."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

from rov_fmu.io.messages import listed
from verification.identification.strangers.judge import NEAR, QUANTITIES, Judged, JudgedAxis
from verification.identification.strangers.kinds import AS_MODELLED, BY_NAME, FAULTS, STRANGERS

STAGES = Path(__file__).with_name("stages.jsonl")
"""A line for each stage that is kept."""
WORDS = ("good", "usable", "do not use")
RIGHT, FAULTY, NEAR_FIT, SHOWN = (
    "right models",
    "right models with a fault",
    "strangers within 5 % of the fit",
    "strangers",
)
GROUPS = (RIGHT, FAULTY, NEAR_FIT, SHOWN)
FITTED = (RIGHT, FAULTY, NEAR_FIT)
"""The groups whose motion the law fits."""
Table = list[tuple[str, ...]]
Counts = dict[str, list[int]]
"""By verdict: the number of axes, and of those with a wrong answer, a wrong V_ss, a wrong time and a wrong way."""
_LAG = "rotor lag"
"""J alone tells this cause, so that it is no part of what is asked of the others."""


def group_of(one: Judged, axis: JudgedAxis) -> str:
    """Return the group in which an axis of a drawn vehicle counts: one of GROUPS, or `hidden`."""
    kind = BY_NAME[one.kind]
    if kind.group == "law":
        return RIGHT if kind is AS_MODELLED else FAULTY
    if axis.distance is not None and axis.distance <= NEAR:
        return NEAR_FIT
    return SHOWN if kind.group == "stranger" else "hidden"


def stage(name: str, folders: Sequence[Judged]) -> dict[str, Any]:
    """Return what is kept of the drawn folders of a stage."""
    groups: dict[str, Counts] = {}
    kinds: dict[str, Counts] = {}
    widths: dict[str, list[float]] = {quantity: [] for quantity in QUANTITIES}
    offs = list[float]()
    for one in folders:
        for axis in one.axes:
            group = group_of(one, axis)
            for table, key in ((groups, group), (kinds, one.kind if group in (FAULTY, SHOWN, "hidden") else "")):
                counts = table.setdefault(key, {}).setdefault(axis.word, [0] * (2 + len(QUANTITIES)))
                more = 1, axis.is_off(), *(axis.is_off(quantity) for quantity in QUANTITIES)
                counts[:] = map(sum, zip(counts, more, strict=True))
            if group == RIGHT:
                offs += (number.off for number in axis.numbers)
                for number in axis.numbers:
                    widths[number.quantity].append(number.half_width)
    times = [[one.seconds for one in folders if one.count == count] for count in (2, 4)]
    causes = [bool(is_true) for one in folders for cause, is_true in one.causes if not cause.startswith(_LAG)]
    ill = [one for one in folders if BY_NAME[one.kind].causes != "-"]
    return {
        "stage": name,
        "folders": [*map(len, times)],
        "groups": groups,
        "kinds": kinds,
        "widths": {key: median(some) if some else None for key, some in widths.items()},
        "inside": [sum(off <= 1.0 for off in offs), len(offs), median(offs) if offs else None],
        "causes": [sum(causes), len(causes)],
        "named": [sum(any(is_true for _, is_true in one.causes) for one in ill), len(ill)],
        "seconds": [mean(some) if some else None for some in times],
    }


def keep(one: Mapping[str, Any], path: Path = STAGES) -> None:
    """Keep a stage in the place of one with the same name."""
    lines = {each["stage"]: json.dumps(each) for each in [*stages(path), one]}
    path.write_text("".join(f"{line}\n" for line in lines.values()), encoding="utf-8")


def stages(path: Path = STAGES) -> list[dict[str, Any]]:
    """Return the stages that are kept."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def broken(one: Mapping[str, Any]) -> list[str]:
    """Return what is wrong with the verdicts of a stage; a gate of which there is no axis is not broken."""
    some: Mapping[str, Counts] = one["groups"]
    fitted, shown = (_sum((some.get(group, {}) for group in of), "good") for of in (FITTED, (SHOWN,)))
    right = some.get(RIGHT, {})
    good, all_ = _sum([right], "good")[0], _sum([right], *right)[0]
    inside, answers, _ = one["inside"]
    return [
        *(["too many *good* axes that the law fits are wrong"] if fitted[1] > 0.03 * fitted[0] else []),
        *(["too many *good* axes of strangers are wrong"] if shown[1] > 0.08 * shown[0] else []),
        *(["too few axes of right models are *good*"] if good < 0.85 * all_ else []),
        *(["too few answers of right models are inside"] if inside < 0.98 * answers else []),
    ]


# ---- Tables ----------------------------------------------------------------------------------------------------------


def _sum(some: Iterable[Counts], *words: str) -> tuple[int, int]:
    """Return the axes with these verdicts, and those of them with a wrong answer."""
    found = [counts[word] for counts in some for word in words if word in counts]
    return sum(n for n, *_ in found), sum(off for _, off, *_ in found)


def _share(part: int, all_: int) -> str:
    return f"{part} of {all_}" + (f" ({100.0 * part / all_:.0f} %)" if all_ else "")


def _percent(value: float | None) -> str:
    return "" if value is None else f"±{100.0 * value:.1f} %"


def gates(some: Sequence[Mapping[str, Any]]) -> Table:
    """Return the gates of some stages, a column for each."""
    rows: Table = [("", "wanted", *(one["stage"] for one in some))]

    def add(words: str, wanted: str, *cells: str) -> None:
        rows.append((words, wanted, *cells))

    def off(one: Mapping[str, Any], word: str, *groups: str) -> str:
        n, wrong = _sum((one["groups"].get(group, {}) for group in groups), word)
        return _share(wrong, n)

    def are_good(one: Mapping[str, Any], *groups: str) -> str:
        own = [one["groups"].get(group, {}) for group in groups]
        return _share(_sum(own, "good")[0], _sum(own, *{word for counts in own for word in counts})[0])

    def twice(one: Mapping[str, Any]) -> str:
        off = {kind.name: _sum([one["kinds"].get(kind.name, {})], "good")[1] for kind in STRANGERS}
        return listed(kind for kind, wrong in off.items() if wrong > 1 and BY_NAME[kind].group == "stranger") or "none"

    def inside(one: Mapping[str, Any]) -> str:
        part, all_, half = one["inside"]
        return _share(part, all_) + (f", {half:.2f}" if all_ else "")

    add(
        "*good* axes that the law fits, with a wrong answer",
        "at most 3 %",
        *(off(one, "good", *FITTED) for one in some),
    )
    add(f"*good* axes of {SHOWN}, with a wrong answer", "at most 8 %", *(off(one, "good", SHOWN) for one in some))
    add("their *usable* axes with one", "at most 8 %", *(off(one, "usable", SHOWN) for one in some))
    add("kinds with two such *good* axes", "none", *map(twice, some))
    add(f"answers of {RIGHT} inside; median error in half-widths", "98 %, 0.45", *map(inside, some))
    add(f"*good* of {RIGHT}", "at least 85 %", *(are_good(one, RIGHT) for one in some))
    add(f"*good* of {NEAR_FIT}", "at least 85 %", *(are_good(one, NEAR_FIT) for one in some))
    widths = (f"V_ss of {RIGHT}, median", "±3.5 %"), ("their times", "±5 %"), ("their stopping distances", "±10 %")
    for (words, most), quantity in zip(widths, QUANTITIES, strict=True):
        add(words, f"at most {most}", *(_percent(one["widths"].get(quantity)) for one in some))
    add("true causes of those told, but for a lag", "98 %", *(_share(*one["causes"]) for one in some))
    add("vehicles with a fault whose cause is told", "90 %", *(_share(*one["named"]) for one in some))
    seconds = (
        " and ".join(f"{s:.0f} s" for s, n in zip(one["seconds"], one["folders"], strict=True) if n) for one in some
    )
    add("processor time, mean of two and of four axes", "1.2 times", *seconds)
    add("folders with two and with four axes", "160 and 40", *(" and ".join(map(str, one["folders"])) for one in some))
    return rows


def by_kind(some: Sequence[Mapping[str, Any]], *, hidden: bool = False) -> Table:
    """Return how many axes of each kind got each verdict, and of how many a V_ss, a time or a way is wrong."""
    heads = [f"{one['stage']}: {word}" for one in some for word in WORDS]
    rows: Table = [("", "what it does", *heads)]
    kinds = [kind for kind in (*FAULTS, *STRANGERS) if (kind.group == "hidden") == hidden]
    named = [] if hidden else [(group, "", "groups", group) for group in GROUPS]
    for name, what, table, key in [*named, *((kind.name, kind.what, "kinds", kind.name) for kind in kinds)]:
        cells = [_cell(one[table].get(key, {}), word) for one in some for word in WORDS]
        rows.append((name, what, *cells))
    return rows


def _cell(counts: Counts, word: str) -> str:
    n, _, *wrong = counts.get(word, [0] * (2 + len(QUANTITIES)))
    names = [f"{own} {name}" for own, name in zip(wrong, QUANTITIES, strict=True) if own]
    return (f"{n}, off: {listed(names)}" if names else str(n)) if n else ""


def cases(folders: Iterable[Judged]) -> Table:
    """Return a row for each axis of some folders."""
    rows: Table = [("folder", "axis", "verdict", "tested", "inside", "largest error, half-widths", "causes", "s")]
    for one in folders:
        told = {None: "", True: " (true)", False: " (false)"}
        causes = "; ".join(text + told[is_true] for text, is_true in one.causes) or one.error
        for n, axis in enumerate(one.axes):
            offs = [number.off for number in axis.numbers]
            inside = f"{sum(off <= 1.0 for off in offs)} of {len(offs)}"
            largest = max(axis.numbers, key=lambda number: number.off, default=None)
            words = f"{largest.off:.1f} ({largest.quantity} at {100.0 * largest.command:+.0f} %)" if largest else ""
            commands = [number.command for number in axis.numbers]
            ends = min([0.0, *commands]), max([0.0, *commands])
            tested = f"{100.0 * ends[0]:.0f} to {100.0 * ends[1]:.0f} %"
            tail = (causes, f"{one.seconds:.0f}") if n == 0 else ("", "")
            rows.append((one.name if n == 0 else "", axis.axis, axis.word, tested, inside, words, *tail))
        if not one.axes:
            rows.append((one.name, "", "nothing tested", "", "", "", causes, f"{one.seconds:.0f}"))
    return rows
