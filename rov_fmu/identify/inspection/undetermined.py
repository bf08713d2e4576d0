"""What recordings cannot determine, and why, told before any fit."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.beginning import layout_of
from rov_fmu.identify.findings import (
    LOG_OUTPUTS,
    UNLOGGED,
    how_to_measure,
    how_to_record,
    is_unlogged,
    result_sentences,
)
from rov_fmu.identify.given import thrusters_along_no_other
from rov_fmu.identify.likelihood.hypotheses import HYPOTHESES, lost_in_words, thrusters_alike
from rov_fmu.identify.likelihood.records import driven_axes, lost_between_rows
from rov_fmu.identify.result import without
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import brief, listed
from rov_fmu.io.numbers import percent
from rov_fmu.tank.columns import COMMAND, push_along
from rov_fmu.tank.description import ROV_FILE, Description
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.inspection.headers import may_be_velocity
from rov_fmu.tank.log import Commands, Log

_LEAST_PUSH, _ASIDE = 0.1, 1.0 / 3.0
"""An axis is commanded alone where its command is above the first number, a fraction of the full one, and those of the
axes that share thrusters with it are below the second one, relative to it."""
_LEAST_TIME = 1.0
"""An axis that is commanded alone for less than this time, s, is never commanded alone."""
_MOST_NAMES = 3
"""The largest number of headers in a sentence."""
_FULL = 0.95
"""A command above this counts as full."""
_REASONS = {
    "constant push": "the thrust along {it} never changes",
    "cancelling thrusters": "the thrusters along {it} cancel each other all the time",
    "no thruster": "no thruster drives {it}",
    "constant motion": "what is measured of {it} never changes",
    "too few samples": "too few samples show {it}",
}
"""Why a log that measures the motion along an axis tells nothing about it, by the kind of the finding."""


def undetermined(
    logs: Sequence[Log], description: Description, measured: Collection[str], unread: Sequence[str] = ()
) -> Iterator[str]:
    """Yield a sentence for everything that logs cannot determine about the vehicle that a rov.toml describes.

    The forces of the `measured` thrust curves are in tables. `unread` are headers that are not recognised. Nothing is
    fitted: it follows from what is measured, and from how the thrusters are commanded.
    """
    layout = description.logged
    concerned = {log: layout_of(log, description) for log in logs}
    driven: dict[Log, list[Axis]] = {}
    findings: list[Finding] = []
    for log, part in concerned.items():
        driven[log], of_log = driven_axes(log, part)
        findings += of_log
    tested = {axis for axes in driven.values() for axis in axes}
    untested = [axis for axis in layout.bare_axes if axis not in tested]
    sources = dict.fromkeys(untested, description.base_name)
    sources |= {axis: ROV_FILE for axis in untested if axis.coefficient("a_d") in description.known}
    kept = [axis for axis in layout.bare_axes if sources.get(axis, ROV_FILE)]
    reasons = ((*_reason(axis, layout, findings, logs, unread), sources[axis]) for axis in untested)
    for (reason, sensor, base), axes in grouped(zip(reasons, untested, strict=True)).items():
        named, are_many = listed([axis.name for axis in axes]), len(axes) > 1
        gone = thrusters_along_no_other(layout, axes, kept)
        stays = f"{'stay those' if are_many else 'stays that'} of {base}"
        stays = stays if base else f"cannot be identified, so {without(axes, gone)}"
        why = reason.replace("{it}", named)
        how = how_to_record(axes) if sensor else f"Command {'each' if are_many else 'it'} both ways"
        how = LOG_OUTPUTS if reason == UNLOGGED else how
        yield f"{named} {stays}: {why}. {how}"
    if not layout.has_wrench:
        weak: list[str] = []
        for axis in (axis for axis in layout.bare_axes if axis in tested):
            own = [log.commands for log, axes in driven.items() if axis in axes and log.commands]
            largest, told = _by_commands(axis, own, layout)
            yield from told
            if 0.0 < largest < _FULL:
                weak.append(f"{percent(largest)} in {axis.name}")
        if weak:
            yield f"speeds beyond the strongest commands, {listed(weak)}, are extrapolated"
        values = [log.commands.in_rows for log in logs if log.commands and not log.follows_axis]
        for group in thrusters_alike(layout, values):
            if len(group) > 1:
                yield from result_sentences([about("", "not told apart", of=listed(group))])
        for log, part in concerned.items():
            if log.commands and (lost := lost_between_rows(log, part)):
                words = lost_in_words(lost, log.commands.interval)
                yield HYPOTHESES["momentary commands"].sentence.format(of=log.file, **words)
        known = {c.name for c in layout.curves if c.coefficient("a_t") in description.known}
        assumed = (c.name for c in layout.curves if c.name not in known.union(measured))
        yield from result_sentences(Finding("assumed thrust", curve=name) for name in assumed)


def _reason(
    axis: Axis, layout: Layout, findings: Sequence[Finding], logs: Sequence[Log], unread: Sequence[str]
) -> tuple[str, str]:
    """Return why no log tests an axis, which is {it} in the reason, and what would show its motion, or an empty text
    where the logs do."""
    sensor = how_to_measure(axis, "<axis>")
    if is_unlogged(axis, layout, logs):
        return UNLOGGED, ""
    kinds = dict.fromkeys(finding.kind for finding in findings if finding.axis == axis.name)
    if reasons := [_REASONS[kind] for kind in kinds if kind in _REASONS]:
        return listed(reasons), sensor if {*kinds} & {"constant motion", "too few samples"} else ""
    unused = [c for log in logs for c in log.channels if c.quantity.axis is axis and c.unused]
    if unused:
        return f"{unused[0].quantity.name} from {unused[0].source} is left out ({unused[0].unused})", sensor
    what = "an angle or a rate" if axis.is_rotation else "a velocity or a position"
    possible = possible_headers(axis, unread)
    doubt = f", unless {listed(possible, 'or')} is one" if possible else ""
    return f"no log has {what} of {{it}}{doubt}", sensor


def possible_headers(axis: Axis, unread: Iterable[str]) -> list[str]:
    """Return the first unknown headers that may be of a velocity along an axis, each once."""
    possible = (brief(title) for title in unread if may_be_velocity(title, is_rotation=axis.is_rotation))
    return [*dict.fromkeys(possible)][:_MOST_NAMES]


def _by_commands(axis: Axis, logs: Sequence[Commands], layout: Layout) -> tuple[float, list[str]]:
    """Return the largest command along an axis in the logs that test it, and a sentence if it is never commanded
    alone."""
    others = [
        other
        for other in layout.bare_axes
        if other is not axis and layout.shares_thrusters(axis, other) and axis.is_rotation + other.is_rotation < 2
    ]
    alone, largest, beside = 0.0, 0.0, dict.fromkeys(others, 0.0)
    for commands in logs:
        values = commands.in_rows
        own = push_along(layout, axis, values)
        pushed = {other: np.abs(push_along(layout, other, values)) for other in others if COMMAND not in values}
        most = np.max([*pushed.values()], axis=0) if pushed else np.zeros(len(own))
        is_used = np.abs(own) > _LEAST_PUSH
        alone += commands.interval * float(np.sum(is_used & (most < _ASIDE * np.abs(own))))
        for other, push in pushed.items():
            beside[other] += commands.interval * float(np.sum(is_used & (push >= _ASIDE * np.abs(own))))
        largest = max(largest, float(np.abs(own).max(initial=0.0)))
    together = [other.name for other, time in beside.items() if time >= _LEAST_TIME]
    if alone >= _LEAST_TIME or not together:
        return largest, []
    words = f"{axis.name}: known less well, because it is never commanded alone, only together with {listed(together)}"
    return largest, [f"{words}. Command it alone for some seconds, both ways"]
