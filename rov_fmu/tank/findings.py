"""Findings about data: what was left out, what the data cannot determine, and what contradicts the model.

A finding is data. Its sentence and its heading come from a table by kind: HEADINGS below for findings about reading
files, and that of rov_fmu/identify/findings.py for the others.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from rov_fmu.io.messages import listed

Heading = Literal["Warnings", "Doubts", "Facts"]
"""Warnings ask for something, doubts are open questions, and facts need no action."""


@dataclass(frozen=True)
class Finding:
    """Something worth telling the user."""

    kind: str
    axis: str = ""
    curve: str = ""
    file: str = ""
    words: Mapping[str, str | float] = field(default_factory=dict)
    """The words and the numbers that the sentence needs. In a sentence about several files, numbers become ranges; a
    number that must not is given as text."""


def about(file: str, kind: str, axis: str = "", /, **words: str | float) -> Finding:
    """Return a finding about a file, with the words and the numbers that its sentence needs."""
    return Finding(kind, axis, file=file, words=words)


MISFITS = ("motors without thruster", "thrusters without pulse")
"""The kinds of findings about logs whose motors are not the thrusters of the vehicle."""

REFUSED = ("signs", "too short")
"""The kinds of findings about logs that are not worth a fit."""

_WARNINGS = {
    "copy": "{files}: left out as a copy of {original}, because the same data must not count twice",
    "tank tests": "{files}: read as tables of tank tests",
    "unnamed table": "{files}: a table with the {measured} at each command: name it {name}",
    "stray times": (
        "{files}: {count:#time stamp} hours or years from all others left out. The file is damaged, or a clock was set"
    ),
    "column without unit": "{files}: {column} is not read, because its header has no unit. Write for example {header}",
    "mark": (
        "{files}: {count:#value} of {columns} left out, because {what} is far from all others: a mark that nothing was "
        "measured"
    ),
    "only mark": "{files}: {columns} left out, because all numbers are {what}: a mark that nothing was measured",
    "below any": "{files}: {count:#value} of {columns} left out, because no measurement is below {what}",
    "missing column": (
        "{files}: there is no column of {column}. Its command is taken as 0. Add the column if this is wrong"
    ),
    "frozen sensors": (
        "{files}: {sensors} do not change any more after {start:.4g} s, although the log ends at "
        "{end:.4g} s. Did the log or the sensor stop? Their later values are left out"
    ),
    "nothing measured": "{files}: nothing measured of any axis",
    "no thruster": (
        "{files}: nothing is learnt about {axes}: no thruster drives it, and the effect of fins is not fitted"
    ),
    "axis not pushed": (
        "{axes}: the logs have its motion, but in all of them its thrusters cancel each other, so the vehicle has no "
        "{axes}. If it was driven that way, check the directions of the thrusters and the signs of their commands"
    ),
    "unreadable file": "{files}: left out as unreadable: {reason}",
    "channel left out": "{files}: {source} is left out for {quantities}: {words}",
    "clock restarts": "{files}: the clock restarts or jumps after {at} s. The log is read as two, before and after",
    "unlikely rate": (
        "{files}: the column {column} gives {rate} rows a second. Is its unit another one: s, ms, us or ns?"
    ),
    **dict.fromkeys(
        ("signs", "doubtful signs"),
        "{files}: the log contradicts {what} by {errors:.0f} standard errors: {why}",
    ),
    "too short": (
        "the dives take {seconds} s, and nothing is pushed both ways for a second: that determines nothing. Fly "
        "longer, for two minutes or more, with weak and strong commands of both signs along each axis"
    ),
    "perhaps at rest": (
        "{files}: the outputs hardly rest at 1500 us, which is taken as no thrust, and most stay at {rest} us. If that "
        "is no thrust, write neutral = {key} into [logs] of rov.toml"
    ),
    "parameter changed": "{files}: {name} changed {at} s after the first command. Each value is used in its time",
    "jumps": "{files}: {count:#jump} of the {quantity}, as by a reset: {jumps}",
    "damaged log": "{files}: the log is damaged in places. The parts that could be read are used",
    "cut": (
        "{files}: the file ends amid its messages, as after a loss of power. {read} read, and what was recorded later "
        "is missing"
    ),
    "several vehicles": (
        "{files}: the log has the vehicles {vehicles}. {vehicle} is used; `vehicle` in [logs] of rov.toml names another"
    ),
    "motors without thruster": (
        "{files}: there are commands of {whose}, but the vehicle has no thruster for them, so that forces and inertias "
        "come out wrong{frames}"
    ),
    "thrusters without pulse": (
        "{files}: no pulses come to the thrusters {whose}, so that forces and inertias come out wrong{frames}"
    ),
    "together": (
        "{files}: the motion in {axes} is left out, because the thrusters drive it only together with other axes. If "
        "that is wrong, correct their directions, or write [axes.{axis}] into rov.toml"
    ),
    "fins not fitted": (
        "{fins}: the lift of fins is not fitted. The vehicle has the given one, and motion that fins cause is not "
        "explained"
    ),
}
_DOUBTS = {
    "grown rows": (
        "{files}: from line {line} on, rows have {cells} cells, and the header has {columns}. Their first {first} and "
        "last {last} are taken as the first and last columns of the header. Complete the header if this is wrong"
    ),
    "late command": "{files}: {column} has no command before {at} s. Until then, its command is taken as 0",
    "too few samples": ("{files}: the {quantity} has {count:#sample} and needs at least {least:g}, so it is left out"),
    "at rest": (
        "{files}: no thrust is {rest} us, because the outputs rest there and never at 1500 us. If that is wrong, write "
        "neutral = 1500 into [logs] of rov.toml"
    ),
    "time of arrival": (
        "{files}: {count:#message} of {topics} without a time in the header: the time of arrival is used"
    ),
    "other clock": (
        "{files}: it has another clock than the commands. Its times are used as they are, as if both clocks agreed. "
        "Correct them if they do not"
    ),
    "aligned clock": (
        "{files}: it has another clock than the commands, and their times do not overlap. Its first sample is moved to "
        "the first command, as if both had begun at once. Correct its times if they did not"
    ),
    "unknown direction": (
        "{files}: the log does not tell the directions of the motors (MOT_n_DIRECTION), so every thruster is taken to "
        "push ahead above its neutral pulse. [logs] in rov.toml may name those that do not: reversed = [...]"
    ),
    "unknown velocity": "{files}: {count:#velocity} left out, because the filter marks them as unknown",
    "depth by pressure": "{files}: the depth is computed from the {by}",
}
_FACTS = {
    "other files": "{files}: not read, because {reason}",
    "code page": "{files}: it is not in UTF-8, so it is read in code page 1252 of Windows",
    "lines before header": "{files}: {count:#line} before the header not read",
    "rows sorted": "{files}: {count:#row} out of order sorted",
    "time stamps merged": "{files}: {count:#repeated time stamp} merged",
    "rows without time": "{files}: {count:#row} without a time left out",
    "rows without numbers": "{files}: {count:#row} with a time and no number left out",
    "rows before commands": "{files}: {count:#row} before the first command left out",
    "torn rows": "{files}: {count:#row} with a wrong number of cells left out",
    "broken lines": "{files}: {count:#line} left out, which are cut or have a wrong checksum",
    "unread cells": "{files}: {count:#cell} of {column} without a number: taken as blank",
    "leave out": "{files}: {axes} left out, as [leave_out] in rov.toml says",
    "invalid": "{files}: {count:#value} of {columns} left out, because {what} says that they are invalid",
    "no pulse": "{files}: {count:#pulse} of {column} of 0 or 65535 us taken as no command",
    "beyond full thrust": "{files}: {count:#command} of {column} beyond full thrust taken as full thrust",
    "constant motion": "{files}: the {quantity} never changes, so it is left out",
    "constant push": "{files}: nothing is learnt about {axes}: the thrust along it never changes",
    "free decay": (
        "{files}: the motion in {axes} slows down without thrust, which tells drag relative to inertia, but not the "
        "velocities that the thrusters give"
    ),
    "cancelling thrusters": ("{files}: nothing is learnt about {axes}: its thrusters cancel each other all the time"),
    "gaps": "{files}: {count:#gap} in the {quantity}: {gaps}",
    "interruption": (
        "{files}: nothing is logged for {gaps}, so the commands are unknown there. What follows counts as another log"
    ),
    "rests": (
        "{files}: {left} s are left out, {rests}: there, a push that moves it elsewhere hardly does, as if it rested "
        "against something"
    ),
    "source": "{files}: {quantities} from {source}, {rate:.3g} Hz{words}",
    "source of commands": "{files}: the commands of the thrusters are those of {source}{others}",
    "source of wrench": "{files}: the forces and moments on the body are those of {source}{others}",
    "wrench": (
        "the commands are forces and moments along the axes of the body, forward, starboard and down. 100% of a "
        "command is the largest of all logs: {full}. {inputs}"
    ),
    "range of pulses": "{files}: full thrust is {low} and {high} us, and no thrust {neutral} us",
    "dropouts": "{files}: the autopilot lost data {count:#time}, for up to {longest:.3g} s",
    "damaged pieces": "{files}: {count:#damaged piece} left out",
    "no servo pulse": "{files}: {count:#pulse} of 0 or 65535 us taken as no command",
    "reversed motors": "{files}: parameters of the autopilot reverse the thrusters {thrusters}",
    "axis left out": "{axes}: neither tested nor known ({drag}), so the vehicle has no {axes}",
    "not coupled": "surge, sway and yaw are not coupled, because coupling needs all three axes",
    "unused curve": (
        "{files}: the thrusters of curve {curve} act on no axis that is tested or known, so it is not used"
    ),
}
HEADINGS: Mapping[Heading, Mapping[str, str]] = {"Warnings": _WARNINGS, "Doubts": _DOUBTS, "Facts": _FACTS}
"""The sentences about reading tests, by heading and kind of finding: format strings that get {axes}, {files}, {curve},
and the words of the finding. The format `{count:#row}` gives "1 row" or "2 rows"."""
SENTENCES = {kind: form for forms in HEADINGS.values() for kind, form in forms.items()}
"""The same by kind."""


def sentences(findings: Iterable[Finding], forms: Mapping[str, str] = SENTENCES) -> tuple[str, ...]:
    """Return the sentences of the findings; similar findings share one sentence.

    Findings about files share a sentence when they differ only in the file, the axis and the numbers; other findings,
    when they differ only in the axis. Each axis in a sentence belongs to each of its files.
    """
    by_file: dict[tuple[object, ...], list[Finding]] = {}
    for finding in findings:
        same = (pair if isinstance(pair[1], str) or not finding.file else pair[0] for pair in finding.words.items())
        by_file.setdefault((finding.kind, finding.curve, finding.file, *same), []).append(finding)
    groups: dict[tuple[object, ...], list[Finding]] = {}
    for (kind, curve, file, *rest), found in by_file.items():
        axes = tuple(dict.fromkeys(finding.axis for finding in found))
        groups.setdefault((kind, curve, bool(file), axes, *rest), []).extend(found)
    return tuple(_sentence(group, forms) for group in groups.values())


def _sentence(group: Sequence[Finding], forms: Mapping[str, str]) -> str:
    first = group[0]
    values = {
        "axes": listed(dict.fromkeys(finding.axis for finding in group)),
        "files": listed(dict.fromkeys(finding.file for finding in group)),
        "curve": first.curve,
        **{
            name: word if isinstance(word, str) else _Range([finding.words[name] for finding in group])
            for name, word in first.words.items()
        },
    }
    return forms[first.kind].format(**values)


class _Range:
    """A number, or the range of several numbers, in a format string."""

    def __init__(self, numbers: Sequence[Any]) -> None:
        self.low, self.high = min(numbers), max(numbers)

    def __format__(self, spec: str) -> str:
        _, is_count, noun = spec.partition("#")
        number_format = "g" if is_count else spec
        low, high = format(self.low, number_format), format(self.high, number_format)
        words = low if low == high else f"{low} ... {high}"
        if not is_count:
            return words
        plural = f"{noun.removesuffix('y')}ies" if noun.endswith("y") else f"{noun}s"
        return f"{words} {noun if self.high == 1 else plural}"
