"""What `identify` says of a folder, beside the truth. All of it is read from the result object and from its sentences.

An answer is tested if the vehicle reached its true V_ss: if that is below the 98 % quantile of the speed in this
direction. The product's own idea of what was tested plays no part.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from csv import DictReader
from dataclasses import asdict, dataclass, field
from math import inf, isfinite, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from rov_fmu.identify.findings import result_sentences
from rov_fmu.identify.identify import identify, load_tests
from rov_fmu.identify.result import Identification
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import FileError
from verification.identification.strangers.drawn import HEADERS, draw
from verification.identification.strangers.fit import answers_of_fit
from verification.identification.strangers.kinds import BY_NAME
from verification.identification.strangers.water import AXES, SURGE, SWAY, Array

COMMANDS = (0.3, -0.3, 0.5, -0.5, 1.0, -1.0)
QUANTITIES = ("V_ss", "time", "way")
MOST_OFF = 1.5
"""An answer is wrong if it is off by more half-widths of its interval."""
NEAR = 0.05
"""A vehicle counts as one that the law fits if no tested answer of the best fit is farther from the truth."""
_REACHED = 1.03
"""An answer is tested up to this share of the speed that was reached, because a held command ends below V_ss."""
_QUANTILE = 0.98
_WINDOW = 0.6
"""The time over which the speed is averaged where only a log shows it, s."""


@dataclass(frozen=True)
class Number:
    """A tested answer, its interval, and the truth."""

    command: float
    quantity: str
    truth: float
    value: float
    low: float
    high: float

    @property
    def off(self) -> float:
        """How many half-widths of its interval the truth is from the value."""
        end = self.high if self.truth > self.value else self.low
        return (self.truth - self.value) / (end - self.value) if end != self.value else inf

    @property
    def half_width(self) -> float:
        """The larger half of the interval, relative to the value."""
        return max(abs(end / self.value - 1.0) for end in (self.low, self.high)) if self.value else inf


@dataclass(frozen=True)
class JudgedAxis:
    """The verdict of an axis, and its tested answers."""

    axis: str
    word: str
    """The verdict; `refused` where nothing was identified."""
    distance: float | None
    """How far the best fit of the law is from the truth, ln; None if nobody knows."""
    numbers: tuple[Number, ...]

    def is_off(self, *quantities: str) -> bool:
        """Return True if an answer, or one of some quantities, is wrong."""
        some = quantities or QUANTITIES
        return any(not number.off <= MOST_OFF for number in self.numbers if number.quantity in some)


@dataclass(frozen=True)
class Judged:
    """What was said of a folder."""

    name: str
    kind: str
    """The name of the kind of a drawn vehicle, or of the folder."""
    count: int
    """The number of axes of a drawn vehicle; 0 for a folder that was given."""
    axes: tuple[JudgedAxis, ...] = ()
    causes: tuple[tuple[str, bool | None], ...] = ()
    """What is told with a probability, as its kind and what has it, and whether it is true; None if nobody knows."""
    seconds: float = nan
    """The processor time of reading and identification, s."""
    error: str = ""

    def line(self) -> str:
        """Return it as a line of JSON."""
        return json.dumps(asdict(self))


def read(line: str) -> Judged:
    """Return what `Judged.line` wrote."""
    table = json.loads(line)
    axes = (a | {"numbers": tuple(Number(**number) for number in a["numbers"])} for a in table["axes"])
    causes = tuple((text, is_true) for text, is_true in table["causes"])
    return Judged(**table | {"axes": tuple(JudgedAxis(**a) for a in axes), "causes": causes})


# ---- Folders ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Said:
    """What `identify` says of a folder."""

    words: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[tuple[str, float], tuple[tuple[float, float, float], ...]] = field(default_factory=dict)
    """V_ss, time and distance with their intervals, by axis and command."""
    causes: tuple[str, ...] = ()
    seconds: float = nan
    error: str = ""

    def judged(self, axis: str, distance: float | None, truth: Mapping[float, Sequence[float]]) -> JudgedAxis:
        """Return an axis with its tested answers, whose truth is given by the command."""
        some = [
            Number(command, quantity, true, *number)
            for command, trues in truth.items()
            for quantity, true, number in zip(QUANTITIES, trues, self.numbers.get((axis, command), ()), strict=False)
        ]
        return JudgedAxis(axis, self.words.get(axis, "refused" if self.error else "not identified"), distance, (*some,))


def _said(folder: Path) -> _Said:
    begin, contradicted = process_time(), tuple[str, ...]()
    try:
        tests = load_tests(folder)
        contradicted = tuple(f"signs {f.words['why']}" for f in tests.folder.findings if f.kind == "signs")
        result = identify(tests)
    except FileError as error:
        return _Said(causes=contradicted, seconds=process_time() - begin, error=str(error))
    except Exception as error:  # a crash is judged like a refusal, so that the other folders are still run
        return _Said(seconds=process_time() - begin, error=f"{type(error).__name__}: {error}")
    return _Said(
        {axis.name: verdict.word for axis, verdict in result.verdicts.items()},
        {
            (axis.axis.name, round(a.command, 6)): tuple((e[0], *e[1]) for e in (a.steady, a.rise, a.stop))
            for axis in result.axes
            for a in axis.answers
        },
        tuple(_causes(result)),
        process_time() - begin,
    )


def _causes(result: Identification) -> Iterator[str]:
    """Yield what is told with a probability, and thrusters that are told as weak."""
    for one in result.findings:
        if one.kind == "weak thruster" or any("probability" in sentence for sentence in result_sentences([one])):
            yield f"{one.kind} {one.words.get('of', '')}".strip()


def name_of(seed: int, count: int, kind: str | None = None) -> str:
    """Return the name of a folder that is drawn; `kind` if all seeds have one kind."""
    return f"{count} axes, seed {seed}" + (f", {kind}" if kind else "")


def judged(seed: int, count: int, kind: str | None = None) -> Judged:
    """Draw the folder of a seed, if given of a kind, identify it, and judge what is said."""
    drawn = draw(seed, count, BY_NAME[kind] if kind else None)
    with TemporaryDirectory(prefix="stranger-") as folder:
        drawn.write(Path(folder))
        said = _said(Path(folder))
    axes = []
    for axis in drawn.axes:
        name = AXES[axis]
        commands = [*dict.fromkeys([*COMMANDS, *(c for of, c in said.numbers if of == name)])]
        truth = drawn.truth(axis, commands)
        kept = are_tested(truth[0], np.array(commands), drawn.motion[:, axis].ravel())
        if not kept.any():
            continue
        tested = [command for command, keep in zip(commands, kept, strict=True) if keep]
        truth, distance = truth[:, kept], 0.0
        if drawn.kind.group != "law":
            ratios = answers_of_fit(drawn, axis, tested) / truth
            distance = float(np.max(np.nan_to_num(np.abs(np.log(ratios)), nan=1.0)))  # NaN: it moves the other way
        axes.append(said.judged(name, distance, dict(zip(tested, truth.T.tolist(), strict=True))))
    causes = tuple((cause, bool(re.fullmatch(drawn.kind.causes, cause))) for cause in said.causes)
    return Judged(name_of(seed, count, kind), drawn.kind.name, count, tuple(axes), causes, said.seconds, said.error)


def judged_case(folder: Path) -> Judged:
    """Judge a folder that has `train` and `truth.json`: `answers` with V_ss, time and distance by `surge +30`.

    Raises DataFileError and OSError.
    """
    path = folder / "truth.json"
    try:
        answers = json.loads(path.read_text(encoding="utf-8"))["answers"]
        by_axis = [
            {_command(key): (*map(float, v),) for key, v in answers.items() if key.startswith(f"{name} ")}
            for name in AXES
        ]
    except (TypeError, ValueError, KeyError, AttributeError):
        raise DataFileError(f'{path}: its answers must be like {{"answers": {{"surge +30": [V_ss, s, m]}}}}') from None
    said, axes = _said(folder / "train"), []
    for axis, (name, own) in enumerate(zip(AXES, by_axis, strict=True)):
        speeds = logged_speeds(folder / "train", axis)
        if own and len(speeds):
            kept = are_tested(np.array([value[0] for value in own.values()]), np.array([*own]), speeds)
            tested = {command: own[command] for command, keep in zip(own, kept, strict=True) if keep}
            if tested:
                axes.append(said.judged(name, None, tested))
    causes = tuple((cause, None) for cause in said.causes)
    return Judged(folder.name, folder.name, 0, tuple(axes), causes, said.seconds, said.error)


def _command(key: str) -> float:
    """Return the command of an answer, such as 0.3 for `surge +30`."""
    return float(key.split()[1]) / 100.0


def are_tested(truth: Array, commands: Array, speeds: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which answers are tested, by the true V_ss of each command and the speeds in all dives."""
    kept = []
    for V, command in zip(truth, commands, strict=True):
        same = np.sign(command) * speeds
        same = same[same > 1e-3 * np.abs(speeds).max(initial=1e-9)]
        reached = float(np.quantile(same, _QUANTILE)) if len(same) else 0.0
        kept.append(isfinite(V) and V * command > 0.0 and abs(V) <= _REACHED * reached)
    return np.array(kept, dtype=bool)


def logged_speeds(folder: Path, axis: int) -> Array:
    """Return the speeds along an axis by the columns of the logs in a folder, averaged over a short time."""
    found = [np.zeros(0)]
    for path in sorted(folder.glob("*.csv")):
        with path.open(encoding="utf-8") as file:
            rows = [(row.get("time [s]"), row.get(HEADERS[axis])) for row in DictReader(file)]
        there = np.array([(float(t), float(value)) for t, value in rows if t and value])
        if len(there) < 20:
            continue
        time, values = there.T
        size = max(round(_WINDOW / float(np.median(np.diff(time)))), 1)
        if axis in (SURGE, SWAY):
            found.append(np.convolve(values, np.ones(size) / size, "valid"))
        else:
            angles = np.unwrap(np.radians(values)) if "deg" in HEADERS[axis] else values
            found.append((angles[size:] - angles[:-size]) / (time[size:] - time[:-size]))
    return np.concatenate(found)
