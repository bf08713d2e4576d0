"""Numbers of a log that are no measurements: those that a flag says are invalid, and marks such as -32.768 or -9999.

A column or field whose name has the word `valid` is a flag: of the quantities that its other words mean (`dvl_valid` of
the velocities, `depth_valid` of the depth), or, without other words, of all in the same message or row. The table
[valid] of rov.toml names others. VALIDITIES of the catalogue has the other marks of validity inside messages, such as a
covariance of -1.

A mark is known by what it is to the other numbers, and no list of marks is needed: it repeats exactly, and lies farther
from all others than these lie from each other, so that a vehicle would have to jump there and back between two samples.
The numbers of a sensor that saturates, rests or wraps are near others. A velocity of 0 is never a mark.

If all numbers are the same, no others tell whether it is a mark. It is one if it is beyond the bounds of the quantity,
and so is the largest or least integer of a type if it is no motion. What the catalogue says is below any measurement,
such as a voltage of 0, is none either.

All rules apply to the numbers as they stand in the log, before a vector is rotated into another frame.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation.units import in_degrees
from rov_fmu.io.columns import Column, KnownColumns
from rov_fmu.io.messages import listed
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.catalogue import (
    FLAGS,
    MESSAGES,
    QUANTITIES,
    QUATERNION,
    VALIDITIES,
    VECTORS,
    MeasuredQuantity,
    words_of,
)
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.clocks import held
from rov_fmu.tank.columns import ColumnNames, LogColumn
from rov_fmu.tank.findings import Finding, about

_OUTERMOST, _LEAST_OTHERS = 2, 10
"""The largest number of marks on each side of the measurements that are found at once, and the least number of other
values whose range is known well."""
_FAR, _FAR_ONCE = {True: 3.0, False: 1.0}, {True: 100.0, False: 10.0}
"""A mark is farther from all others than this many times their range, that of a velocity (True), which may change
quickly, or of another quantity (False). A number that occurs only once may be a short motion, or an outlier, which the
fit can bear."""
_FAR_FROM_FEW = 100.0
"""A mark among few other values is farther from them than this many times their range and their size."""
_TURN = 2.1 * pi
"""The largest range of an angle that wraps, rad."""
_EXTREMES = [sign * 2.0**bits - shift for bits in (15, 16, 31, 32) for sign, shift in ((1.0, 1.0), (-1.0, 0.0))]
_DECIMALS = 4
"""The largest and the least numbers of integers, of which fewer digits than this may be behind the decimal point."""
_GAP_INTERVALS = 10.0
"""Between samples that are farther apart than this many usual intervals, a vehicle may move."""
_VALID = {"valid", "validity", "invalid"}
"""The words that make a name that of a flag."""
_OFF_NORM = 0.1
"""A quaternion whose norm differs from 1 by more than this is no rotation."""
_OF_PARTS = {"beam", "beams", "range", "ranges"}
"""The words that make a flag that of a part of a measurement, without which the sensor may well have measured."""
_TRUE, _FALSE = ("true", "t", "yes", "valid", "ok", "a"), ("false", "f", "no", "invalid", "v")


def truth(text: str) -> float:
    """Return 1 or 0 for the text of a flag, such as `true`, or NMEA's `V`. Raises ValueError."""
    return float((*_FALSE, *_TRUE).index(text.casefold()) >= len(_FALSE))


_Meaning = tuple[Sequence[str], Callable[[Array], Array]]
"""The quantities that a field tells, and the conversion of its numbers to SI units."""
FLAG = Column({"1": 1.0}, optional=True, blanks=True, parse=truth)
"""The column of a flag of validity."""


def flag_of(name: str, valid: Mapping[str, Sequence[str]], field: str = "") -> dict[str, bool]:
    """Return the quantities of which a column or field is a flag, with the value of the flag where they are valid.

    `field` is the field of a message, whose topic does not tell what the flag is about. `valid` is the table [valid] of
    rov.toml, where a minus before the name of a quantity means that a true flag marks what is invalid.
    """
    if name in valid:
        return {quantity.removeprefix("-"): not quantity.startswith("-") for quantity in valid[name]}
    words = words_of(re.split(r"[\[(]", field or name)[0])
    if not words & _VALID or words & _OF_PARTS:
        return {}
    others = words - _VALID - {"is", "flag", "data", "measurement"}
    exact = {"velocity" if word in ("rate", "speed") else word for word in others}
    named = {quantity for quantity in QUANTITIES if " " in quantity and {*quantity.split()} <= exact}
    meant = named or {quantity for pattern, of in FLAGS for quantity in of if re.search(pattern, " ".join(others))}
    return dict.fromkeys(meant if others else QUANTITIES, "invalid" not in words)


def flag_columns(titles: Iterable[str], known: Mapping[str, LogColumn], names: ColumnNames) -> dict[str, str]:
    """Return the headers of a table that are flags of validity, by the names under which they are read."""
    is_column = KnownColumns(known).has
    unknown = (title for title in dict.fromkeys(titles) if not is_column(names.columns.get(title, title)))
    return {f"flag {n}": title for n, title in enumerate(unknown) if flag_of(title, names.valid)}


@dataclass(frozen=True)
class _Flag:
    """A flag of validity: n times, s, and whether the quantities are valid from then on."""

    name: str
    topic: Topic | None
    """The topic that it concerns, if its name tells what it is about; None for one of rov.toml."""
    quantities: Mapping[str, bool]
    time: Array
    is_true: Flags

    def denies(self, topic: Topic, quantities: Collection[str]) -> Flags:
        """Return True at the times of a topic at which the flag says that one of these quantities is invalid."""
        is_about = self.topic in (None, topic)
        invalid = [not valid for name, valid in self.quantities.items() if is_about and name in quantities]
        return np.isin(held(self.time, self.is_true, topic.time), invalid)


def measured_only(
    file: str, topics: Sequence[Topic], entries: Mapping[str, LogColumn], valid: Mapping[str, Sequence[str]]
) -> tuple[list[Topic], list[Finding]]:
    """Return the topics with NaN in place of numbers that are no measurements, and findings about these.

    `entries` are the meanings of fields beside those of the catalogue.
    """
    flags = [*_flags(topics, valid)]
    left: dict[tuple[str, str], dict[str, int]] = {}

    def without(values: Array, gone: Flags, kind: str, what: str, column: str) -> Array:
        gone &= np.isfinite(values)
        if gone.any():
            left.setdefault((kind, what), {})[column] = int(gone.sum())
        return np.where(gone, np.nan, values)

    kept = []
    for topic in topics:
        fields = dict(topic.fields)
        for denied, gone, what in _denied(topic):
            for field in denied:
                fields[field] = without(fields[field], gone.copy(), "invalid", what, topic.full_name(field))
        for field, (quantities, convert) in _measured(topic, entries).items():
            column = topic.full_name(field)
            for flag in flags:
                fields[field] = without(fields[field], flag.denies(topic, quantities), "invalid", flag.name, column)
            quantity = QUANTITIES[quantities[0]]
            factor, unit = in_degrees(quantity.unit)
            in_si = convert(fields[field])
            least = f"{factor * quantity.least:g} {unit}"
            fields[field] = without(fields[field], in_si < quantity.least, "below any", least, column)
            in_si = np.where(in_si < quantity.least, np.nan, in_si)
            for mark, kind in marks(topic.time, in_si, quantity).items():
                fields[field] = without(fields[field], in_si == mark, kind, f"{factor * mark:.6g} {unit}", column)
        kept.append(replace(topic, fields=fields))
    findings = [
        about(file, kind, what=what, columns=listed(counts), count=sum(counts.values()))
        for (kind, what), counts in left.items()
    ]
    return kept, findings


def _denied(topic: Topic) -> Iterator[tuple[Collection[str], Flags, str]]:
    """Yield fields of a topic, where the same messages say that they are no measurements, and what says it."""
    for validity in VALIDITIES:
        if re.fullmatch(validity.kind, topic.source.kind) and validity.field in topic.fields:
            fields = [field for field in topic.fields if re.fullmatch(validity.about, field)]
            yield fields, validity.denies(topic.fields[validity.field]), topic.full_name(validity.field)
    for message in MESSAGES:
        if message.gives == QUATERNION and topic.has(message):
            norm = np.linalg.norm([topic.fields[field] for field in message.fields], axis=0)
            yield message.fields, np.abs(norm - 1.0) > _OFF_NORM, "the norm of the quaternion"


def _measured(topic: Topic, entries: Mapping[str, LogColumn]) -> dict[str, _Meaning]:
    """Return the quantities that each field of a topic tells, and the conversion of its numbers to SI units.

    Components of quaternions have no marks.
    """
    meanings: dict[str, _Meaning] = {}
    for message in reversed(MESSAGES):
        if message.gives != QUATERNION and topic.has(message):
            what = VECTORS.get(message.gives, (message.gives,)), partial(np.multiply, message.factor)
            meanings |= dict.fromkeys(message.fields, what)
    for field in topic.fields:
        if (entry := entries.get(topic.full_name(field))) and (quantity := entry.quantity):
            convert = entry.convert
            meanings[field] = (quantity.name,), np.vectorize(convert, [float]) if convert else np.asarray
    return meanings


def _flags(topics: Sequence[Topic], valid: Mapping[str, Sequence[str]]) -> Iterator[_Flag]:
    """Yield the flags in topics. One whose name tells what it is about is of the same message or row."""
    for topic in topics:
        for field, values in topic.fields.items():
            name, known = topic.full_name(field), np.isfinite(values)
            quantities = flag_of(name, valid, field)
            if quantities and known.any():
                own = None if name in valid else topic
                yield _Flag(name, own, quantities, topic.time[known], values[known] > 0.0)


# ---- Marks -----------------------------------------------------------------------------------------------------------


def marks(time: Array, values: Array, quantity: MeasuredQuantity) -> dict[float, str]:
    """Return the numbers that mark that nothing was measured, of values in SI units, with the kind of the finding."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    levels, counts = np.unique(values, return_counts=True)
    if len(levels) == 1 and counts[0] > 1:
        level = float(levels[0])
        is_beyond = not quantity.minimum <= level <= quantity.maximum
        integers = level * 10.0 ** np.arange(_DECIMALS)
        is_extreme = quantity.axis is None and np.isclose(integers[:, None], _EXTREMES, rtol=1e-9, atol=0.0).any()
        return {level: "only mark"} if is_beyond or is_extreme else {}
    found: list[float] = []
    while marked := next((own for own in _far(levels, counts, quantity) if _jumps(time, values, levels[own])), None):
        found += levels[marked].tolist()
        levels, counts = np.delete(levels, marked), np.delete(counts, marked)
    return dict.fromkeys(found, "mark")


def _far(levels: Array, counts: NDArray[np.intp], quantity: MeasuredQuantity) -> Iterator[slice]:
    """Yield the indices of the outermost levels, of some in ascending order, that are far from all others.

    The range of the others is that without the outermost ones on both sides, because there may be marks on both.
    """
    is_velocity = quantity.is_velocity
    for number in range(1, _OUTERMOST + 1):
        for own in (slice(None, number), slice(-number, None)):
            outer, others = levels[own], np.delete(levels, own)
            if not len(others) or (is_velocity and 0.0 in outer):
                continue
            distance = float(max(others[0] - outer[-1], outer[0] - others[-1]))
            body = levels[_OUTERMOST:-_OUTERMOST] if len(levels) >= 2 * _OUTERMOST + _LEAST_OTHERS else others
            size = float(np.ptp(body))
            factor = (_FAR_ONCE if counts[own].min() < 2 else _FAR)[is_velocity]
            if quantity.wraps and size < _TURN:
                if np.ptp(levels) < _TURN:
                    continue  # on a circle, it is near
                factor, size = 1.0, 0.5 * _TURN
            elif len(body) < _LEAST_OTHERS:
                factor, size = _FAR_FROM_FEW, max(size, float(np.abs(body).max()))
            if size > 0.0 and distance > factor * size:
                yield own


def _jumps(time: Array, values: Array, levels: Array) -> bool:
    """Return True if a sensor reaches or leaves each level between two samples without a gap between them."""
    intervals = np.diff(time)
    is_soon = intervals <= _GAP_INTERVALS * np.median(intervals)
    return all((is_soon & (np.diff((values == level).astype(int)) != 0)).any() for level in levels)
