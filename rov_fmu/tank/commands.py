"""The commands of the thrusters, from the outputs of an autopilot or of other programs.

Which outputs are meant, and what their numbers mean, is known from the log where it has parameters:

    motor n            the output that SERVOx_FUNCTION or PWM_MAIN_FUNCx assigns to it; otherwise output n
    range of pulses    neutral and span in [logs] of rov.toml; otherwise MOT_PWM_MIN and MOT_PWM_MAX about 1500 us, or
                       SERVOx_MIN, SERVOx_TRIM and SERVOx_MAX; otherwise 1500 us and 400 us. Where all outputs rest at
                       another pulse, and none ever at that neutral pulse, no thrust is where they rest
    direction          MOT_n_DIRECTION, and SERVOx_REVERSED

Each parameter has the value that was valid at the time of the output. ArduPilot applies the range and the direction of
servo x to a motor only if MOT_PWM_TYPE is 8 (PWMRange) or 9 (PWMAngle), and uses MOT_PWM_MIN and MOT_PWM_MAX otherwise
(`AP_Motors::rc_write` and `AP_Motors6DOF::calc_thrust_to_pwm`). A log that does not tell MOT_PWM_TYPE may be of either.
"""

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import Field

from rov_fmu.equation.catalogue import Axis
from rov_fmu.io.columns import NEUTRAL, NO_OUTPUT, SPAN
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import listed, shown
from rov_fmu.io.toml_file import AS_TUPLE, Finite, Strict
from rov_fmu.tank.arrays import Array, spread
from rov_fmu.tank.catalogue import FORCE, MESSAGES, NOT_COMMANDED, OUTPUTS, POSITION, WRENCHES, ThrusterOutput, words_of
from rov_fmu.tank.channels import Topic, frames_of
from rov_fmu.tank.clocks import ascending, held
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.log import Source

PULSE_RANGE = 800.0, 2200.0
"""The range of pulses that speed controllers get, µs."""
_MOST_MOTORS = 12
"""The largest number of motors that an autopilot drives."""
_BY_SERVO = 8.0, 9.0
"""The values of MOT_PWM_TYPE with which the parameters of the servo define the range and the direction of a motor."""
_OFTEN = 0.5
"""An output of which no parameter tells what it drives is a motor's if it changes so often, relative to the others."""
_ARDUPILOT_MOTORS = (*range(33, 41), *range(82, 86))
"""The functions of outputs of ArduPilot that drive the motors 1, 2, ... 12."""
_PER_MODULE = 16
"""The most outputs of an instance of PX4's outputs."""
_PX4_MOTOR = 100
"""The function of output x of PX4 that drives motor n is n more than this."""
_REST, _SHARE, _SELDOM, _BRIEF = 100.0, 0.1, 0.01, 0.1
"""An output rests at its most frequent pulse, if this is nearer to 1500 us than the first number and has the second
share of the rows at least. It does not rest at another pulse that has less than the third share. It hardly rests there
if that pulse has less than the last share of the rows that the most frequent one has."""
_AT_REST, _CLEAR = 2.0, 20.0
"""Two pulses that differ by less than the first number, µs, are the same. One is clearly on a side of the other if they
differ by more than the second."""


class LogKeys(Strict):
    """The table [logs] of rov.toml: what the logs of a folder do not tell."""

    vehicle: str = ""
    """Which of several vehicles in a log: the number of the MAVLink system, or the ROS namespace."""
    outputs: str = ""
    """The topic with the commands of the thrusters."""
    neutral: Annotated[Finite, Field(ge=-1e4, le=1e4)] | None = None
    """The pulse that stops a thruster, µs."""
    span: Annotated[Finite, Field(gt=0.0, le=1e4)] | None = None
    """The distance from the neutral pulse to full thrust, µs."""
    wrench: bool = False
    """True where the commands are forces and moments on the body, although the vehicle has thrusters."""
    reversed: Annotated[tuple[str, ...], AS_TUPLE] = ()
    """The thrusters that push against their directions at a positive command, whatever the parameters of an autopilot
    tell, by name: their wires are swapped. They push astern by the curve ahead, and ahead by that astern."""
    mounted: Annotated[tuple[str, ...], AS_TUPLE] = ()
    """The thrusters that are mounted the other way, by name: their directions are opposite to those of the vehicle."""

    def signs(self, thrusters: Sequence[str]) -> Array:
        """Return -1 for each thruster that is reversed, and 1 for the others."""
        return np.array([-1.0 if name in self.reversed else 1.0 for name in thrusters])


NO_KEYS = LogKeys()
Series = tuple[Array, Array]
"""Times (s, ascending) and values."""
_Sent = TypeVar("_Sent")


@dataclass(frozen=True, eq=False)
class AutopilotParameters:
    """The parameters of an autopilot, with the times at which they were told."""

    told: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)
    """Times (s, ascending) and values, by name."""
    used: set[str] = field(default_factory=set)
    """The names of those whose values were asked for."""

    @classmethod
    def of_pairs(cls, told: Mapping[str, Sequence[tuple[float, float]]], delay: float = 0.0) -> "AutopilotParameters":
        """Return parameters that were told at times that are late by a delay, s, with these values."""
        columns = {name: np.array(pairs, float).T for name, pairs in told.items()}
        return cls({name: ascending(time - delay, values) for name, (time, values) in columns.items()})

    def at(self, name: str, time: Array, default: float = 0.0) -> Array:
        """Return the values that were valid at some times; before the first one was told, it holds already."""
        if name not in self.told:
            return np.full(len(time), default)
        self.used.add(name)
        times, values = self.told[name]
        return held(times, values, time)

    def specific_gravity(self, time: Array) -> Array:
        """Return the specific gravity of the water that ArduSub was told at some times, or 1.

        Its altitudes are computed for this water, and a logged pressure is not: `AP_Baro::update` has altitude =
        (ground pressure - pressure) / 9800 Pa/m / BARO_SPEC_GRAV.
        """
        return self.at("BARO_SPEC_GRAV", time, 1.0)

    def last(self, name: str) -> float | None:
        """Return the last value, or None."""
        return float(self.told[name][1][-1]) if name in self.told else None

    def functions(self, pattern: str) -> Iterator[tuple[re.Match[str], float]]:
        """Yield the match of each name with a pattern, and the last value."""
        for name in self.told:
            if match := re.fullmatch(pattern, name):
                yield match, self.last(name) or 0.0


@dataclass(frozen=True, eq=False)
class _Outputs:
    """The outputs of one sender: a time series for each number."""

    rule: ThrusterOutput
    source: Source
    """The source, or the first one where each thruster has its own."""
    series: Mapping[int, Series]
    """Times (s) and numbers by the number of the output, from 1."""
    topics: Collection[str]
    """The names of the topics with these outputs."""

    @property
    def used(self) -> list[int]:
        """The outputs that ever have a pulse or a finite number other than 0."""
        return [
            n for n, (_, values) in self.series.items() if (np.isfinite(values) & ~np.isin(values, NO_OUTPUT)).any()
        ]

    @property
    def messages(self) -> int:
        """The number of messages of all outputs."""
        return sum(len(time) for time, _ in self.series.values())


@dataclass(frozen=True)
class OutputFunction:
    """What an output drives."""

    output: int
    motor: int
    """0 for an output that drives no motor."""
    parameter: str = ""
    """The parameter that says so, such as `SERVO7_FUNCTION 39`; empty if none does."""

    @property
    def words(self) -> str:
        """The motor with its parameter, or the output."""
        return f"motor {self.motor} ({self.parameter})" if self.parameter else f"output {self.output}"


@dataclass(frozen=True, eq=False)
class Commanded:
    """The commands of a log, and who sent them."""

    series: Mapping[str, Series] = field(default_factory=dict)
    """The commands of each thruster, not yet limited to ±1, or the forces of a wrench, N or N.m, by name; empty where
    the log has none."""
    sender: Source | None = None
    other_vehicles: Collection[str] = ()
    """The other vehicles that have commands."""
    topics: Collection[str] = ()
    """The names of all topics that have commands, also of those that are not used."""
    findings: Sequence[Finding] = ()
    without_pulse: Sequence[str] = ()
    """The thrusters that never get a pulse, although others do."""
    without_thruster: Mapping[str, int] = field(default_factory=dict)
    """The motors for which the vehicle has no thruster, by words about them."""


def commands_of(
    path: Path, topics: Sequence[Topic], thrusters: Sequence[str], parameters: AutopilotParameters, keys: LogKeys
) -> Commanded:
    """Return the commands of the thrusters, which are numbered from 1 if they have no names. Raises DataFileError."""
    candidates = [*_candidates(topics)]
    own = _named(path, "outputs", keys.outputs, candidates, lambda o: o.source.topic)
    own = _named(path, "vehicle", keys.vehicle, own, lambda o: o.source.vehicle)
    if not own:
        return Commanded()
    vehicle = max(own, key=lambda outputs: outputs.messages).source.vehicle
    own = [outputs for outputs in own if outputs.source.vehicle == vehicle]
    modules = _motor_modules(parameters)
    own = [*own, *_joined(own, modules)]
    best = _best(own, len(thrusters), modules)
    functions = _functions(parameters, modules)
    numbers = _motors(best, len(thrusters), functions)
    names = thrusters or [str(n) for n in range(1, len(numbers) + 1)]
    if missing := [name for name, n in zip(names, numbers, strict=True) if n and n not in best.series]:
        count = f"{shown(best.source.topic)} has {len(best.series)} outputs"
        raise DataFileError(f"{path}: no output of thruster {listed(missing)}: {count}")
    vehicles = {outputs.source.vehicle for outputs in candidates} | _alike(vehicle, topics)
    findings = [*_choice(path, best, own, sorted(vehicles))]
    by_name = dict(zip(names, numbers, strict=True))
    are_pulses = _are_pulses(path, best)
    series, meanings = _fractions(path, best, by_name, parameters, keys, are_pulses=are_pulses)
    known = {topic for outputs in candidates for topic in outputs.topics}
    finite = (n for n, (_, values) in best.series.items() if np.isfinite(values).any())
    used = {*(best.used if are_pulses else finite)}
    without = [name for name, n in by_name.items() if n not in used] if used & {*numbers} else []
    extra = _without_thruster(best, numbers, functions)
    return Commanded(series, best.source, vehicles - {vehicle}, known, [*findings, *meanings], without, extra)


def wrench_of(path: Path, topics: Sequence[Topic], axes: Sequence[Axis], keys: LogKeys) -> Commanded:
    """Return the forces along some axes of the wrench that a log has, N, or N.m about them. Raises DataFileError.

    Of several wrenches, the one that changes most is used, unless [logs] names one.
    """
    found: dict[Source, dict[str, Series]] = {}
    for message in WRENCHES:
        for topic in topics:
            if topic.has(message):
                _, body = frames_of(message, topic.source)
                nothing = np.zeros(len(topic.time))
                values = np.column_stack([topic.fields.get(field, nothing) for field in message.fields]) @ body.T
                for axis in axes:
                    if message.fields[axis.place] and axis.is_rotation == (message.gives != FORCE):
                        series = topic.time, np.nan_to_num(values[:, axis.place])
                        found.setdefault(topic.source, {})[axis.external] = series
    own = _named(path, "outputs", keys.outputs, [*found], lambda source: source.topic)
    if not own:
        return Commanded()
    best = max(own, key=lambda source: _activity(found[source]))
    others = [source.topic for source in own if source is not best]
    left = f"; not used: {listed(others)}" if others else ""
    findings = [about(path.name, "source of wrench", source=best.topic, others=left)]
    return Commanded(found[best], best, topics={source.topic for source in found}, findings=findings)


def _activity(series: Mapping[Any, Series]) -> float:
    """Return how much outputs or forces change."""
    return sum(spread(values) for _, values in series.values())


def _alike(vehicle: str, topics: Sequence[Topic]) -> set[str]:
    """Return the other vehicles whose depth or position has a topic of the same name and type as that of a vehicle."""
    gives_position = [message for message in MESSAGES if message.gives in (POSITION, "depth")]
    alike = grouped(
        ((source.kind, source.topic.removeprefix(f"/{source.vehicle}/")), source.vehicle)
        for source in (topic.source for topic in topics if vehicle)
        if any(re.fullmatch(one.kind, source.kind) and re.search(one.topic, source.topic) for one in gives_position)
    )
    return {other for vehicles in alike.values() if vehicle in vehicles for other in vehicles} - {vehicle}


def _choice(path: Path, best: _Outputs, own: Sequence[_Outputs], vehicles: Sequence[str]) -> Iterator[Finding]:
    """Yield findings about the outputs and the vehicle that are used, if there are others."""
    if len(vehicles) > 1:
        yield about(path.name, "several vehicles", vehicles=listed(vehicles), vehicle=best.source.vehicle)
    others = [str(outputs.source) for outputs in own if outputs is not best]
    if others or best.source.topic != best.source.kind:  # a message of an autopilot without rivals explains itself
        left = f"; not used: {listed(dict.fromkeys(others))}" if others else ""
        yield about(path.name, "source of commands", source=str(best.source), others=left)


# ---- Which outputs ---------------------------------------------------------------------------------------------------


def _candidates(topics: Sequence[Topic]) -> Iterator[_Outputs]:
    """Yield all outputs that may be those of the thrusters, in the order of the catalogue's preference.

    The number of an output is that of its field, or that of the topic where each thruster has its own, and the names of
    these topics differ only in it. Outputs that are spread over several messages have the times of the first one.
    """
    for rule in OUTPUTS:
        found: dict[tuple[str, ...] | Topic, dict[int, tuple[Topic, Array]]] = {}
        for topic in topics:
            name, kind = topic.source.topic, topic.source.kind
            match = re.search(rule.topic, name)
            if not match or not re.fullmatch(rule.kind, kind) or NOT_COMMANDED & words_of(name):
                continue
            for title, values in topic.fields.items():
                if of_field := re.fullmatch(rule.field, title):
                    is_numbered = bool(match.groups())
                    sender = (topic.source.vehicle, topic.source.part) if rule.spread else topic
                    alike = (name[: match.start(1)], name[match.end(1) :]) if is_numbered else sender
                    number = int((match if is_numbered else of_field)[1])
                    found.setdefault(alike, {})[number] = topic, values
        for by_number in found.values():
            numbers = sorted(by_number)
            first, _ = by_number[numbers[0]]
            outputs = numbers if rule.spread else range(1, len(numbers) + 1)
            series = {n: (by_number[k][0].time, by_number[k][1]) for n, k in zip(outputs, numbers, strict=True)}
            if rule.spread:
                series = {n: _at_times_of(first.time, *own) for n, own in series.items()}
            yield _Outputs(rule, first.source, series, {topic.source.topic for topic, _ in by_number.values()})


def _at_times_of(rows: Array, time: Array, values: Array) -> Series:
    """Return an output that another message has in the rows of a message: the latest value until half an interval
    after each row."""
    later = 0.5 * float(np.median(np.diff(rows))) if len(rows) > 1 else np.inf
    return rows, values if time is rows else held(time, values, rows + later)


def _named(
    path: Path, key: str, wanted: str, candidates: Sequence[_Sent], name_of: Callable[[_Sent], str]
) -> Sequence[_Sent]:
    """Return the outputs or wrenches that a key of [logs] names, or all without a name. Raises DataFileError."""
    found = [one for one in candidates if wanted in ("", name_of(one))]
    if candidates and not found:
        known = listed(dict.fromkeys(shown(name_of(one)) for one in candidates))
        raise DataFileError(f"{path}: [logs] names the {key} {shown(wanted)}, but the log has {known}")
    return found


def _best(candidates: Sequence[_Outputs], thrusters: int, modules: Mapping[str, int]) -> _Outputs:
    """Return the outputs of one vehicle that drive the motors: those that fit best, and change most."""
    same = [outputs for outputs in candidates if outputs.rule is candidates[0].rule]
    wanted = _instances(modules)
    return max(same, key=lambda o: (o.source.part == wanted, len(o.used) == thrusters, _activity(o.series)))


def _motor_modules(parameters: AutopilotParameters) -> dict[str, int]:
    """Return the modules of PX4's outputs that drive motors, by the functions of the outputs, with their instances.

    The first instance is of the MAIN outputs, if any of these has a function, and the next one of the AUX outputs.
    """
    drives: dict[str, bool] = {}
    for match, function in parameters.functions(r"PWM_(MAIN|AUX)_FUNC\d+"):
        if function:
            drives[match[1]] = drives.get(match[1], False) or 0 < function - _PX4_MOTOR <= _MOST_MOTORS
    return {module: n for n, module in enumerate(sorted(drives, reverse=True)) if drives[module]}


def _instances(modules: Mapping[str, int]) -> str:
    """Return the words for the instances of PX4's outputs that drive motors."""
    return f"instance {' and '.join(map(str, modules.values()))}" if modules else "none"


def _joined(outputs: Sequence[_Outputs], modules: Mapping[str, int]) -> Iterator[_Outputs]:
    """Yield the outputs of several instances together, where motors are on several; those of each begin at a multiple
    of _PER_MODULE."""
    by_part = {one.source.part: one for one in outputs}
    parts = [by_part.get(f"instance {n}") for n in modules.values()]
    found = [one for one in parts if one]
    if len(modules) < 2 or len(found) < len(modules):
        return
    (time, _), topics = next(iter(found[0].series.values())), [topic for one in found for topic in one.topics]
    series = {
        n + _PER_MODULE * index: _at_times_of(time, *own)
        for index, outputs in enumerate(found)
        for n, own in outputs.series.items()
    }
    yield _Outputs(found[0].rule, replace(found[0].source, part=_instances(modules)), series, topics)


def _functions(parameters: AutopilotParameters, modules: Mapping[str, int]) -> dict[int, OutputFunction]:
    """Return what the outputs drive, by the number of the output, as far as the parameters tell it.

    `modules` are those of PX4 that drive motors, whose outputs are numbered together.
    """
    found = {}
    for match, function in parameters.functions(r"(?:SERVO|PWM_(MAIN|AUX)_FUNC)(\d+)(?(1)|_FUNCTION)"):
        motors = range(_PX4_MOTOR + 1, _PX4_MOTOR + 1 + _MOST_MOTORS) if match[1] else _ARDUPILOT_MOTORS
        motor = motors.index(int(function)) + 1 if function in motors else 0
        if motor or not match[1]:  # an output of PX4 that drives no motor may be another one of the same number
            number = int(match[2]) + _PER_MODULE * ([*modules].index(match[1]) if motor and match[1] else 0)
            found[number] = OutputFunction(number, motor, f"{match[0]} {function:g}")
    return found


def _motors(outputs: _Outputs, thrusters: int, functions: Mapping[int, OutputFunction]) -> list[int]:
    """Return the number of the output of each motor, in the order of the motors; 0 for a motor without an output."""
    assigned = {of.motor: of.output for of in functions.values() if of.motor}
    count = thrusters or max(assigned, default=0) or max(outputs.used, default=0)
    others = {of.output for of in functions.values()} if assigned else set()
    return [assigned.get(motor, 0 if motor in others else motor) for motor in range(1, count + 1)]


def _without_thruster(
    outputs: _Outputs, numbers: Sequence[int], functions: Mapping[int, OutputFunction]
) -> dict[str, int]:
    """Return the motors that no thruster is, by words about their outputs.

    The outputs change, and a parameter says that they drive motors. If none tells what an output drives, it changes
    about as often as those of the thrusters, as lights and cameras do not.
    """
    counts = {n: _changes_of(values) for n, (_, values) in outputs.series.items()}
    changing = [counts[n] for n in numbers if counts.get(n)]
    usual = float(np.median(changing)) if changing else np.inf
    driven = [functions.get(n) or OutputFunction(n, n if count >= _OFTEN * usual else 0) for n, count in counts.items()]
    return {of.words: of.motor for of in driven if counts[of.output] and of.motor > len(numbers)}


def _changes_of(values: Array) -> int:
    """Return how often an output changes, without the times at which it has no pulse."""
    there = values[np.isfinite(values)]
    if (np.abs(there) > 1.0).any():
        there = there[~np.isin(there, NO_OUTPUT)]
    return int(np.count_nonzero(np.diff(there)))


# ---- What the numbers mean -------------------------------------------------------------------------------------------


def _fractions(
    path: Path,
    outputs: _Outputs,
    numbers: Mapping[str, int],
    parameters: AutopilotParameters,
    keys: LogKeys,
    *,
    are_pulses: bool,
) -> tuple[dict[str, Series], list[Finding]]:
    """Return the fractions of the full command of each thruster, not yet limited to ±1, and what had to be decided.

    `numbers` has the number of the output of each thruster, in the order of the motors, or 0.
    """
    time, _ = next(iter(outputs.series.values()))
    nothing = time, np.zeros(len(time))
    series = {name: outputs.series[n] if n else nothing for name, n in numbers.items()}
    series = {name: (time, np.nan_to_num(values)) for name, (time, values) in series.items()}
    findings = []
    if outputs.rule.unit != "1" and "MOT_1_DIRECTION" not in parameters.told:
        findings.append(about(path.name, "unknown direction"))
    if not (series and are_pulses):
        return series, findings
    turned, without_pulse = [], 0
    is_open = keys.neutral is None and parameters.last("MOT_PWM_TYPE") not in _BY_SERVO
    sent = {name: values for name, (_, values) in series.items()} if is_open else {}
    trims = {name: parameters.last(f"SERVO{numbers[name]}_TRIM") for name in sent}
    rests, told = at_rest(path.name, sent, trims)
    findings += told
    for motor, (name, (time, values)) in enumerate(series.items(), start=1):
        low, neutral, high = _range(numbers[name], time, parameters, keys, rests.get(name))
        if motor == 1 and (low[-1], neutral[-1], high[-1]) != (NEUTRAL - SPAN, NEUTRAL, NEUTRAL + SPAN):
            ends = {"low": f"{low[-1]:g}", "neutral": f"{neutral[-1]:g}", "high": f"{high[-1]:g}"}
            findings.append(about(path.name, "range of pulses", **ends))
        is_turned = parameters.at(f"MOT_{motor}_DIRECTION", time, 1.0) < 0.0
        if parameters.last("MOT_PWM_TYPE") in (None, *_BY_SERVO):
            is_turned ^= parameters.at(f"SERVO{numbers[name]}_REVERSED", time) > 0.0
        turned += [name] if is_turned.any() else []
        is_none = np.isin(values, NO_OUTPUT)
        without_pulse += int(is_none.sum())
        span = np.where(values > neutral, high - neutral, neutral - low) * np.where(is_turned, -1.0, 1.0)
        series[name] = time, np.where(is_none, 0.0, (values - neutral) / span)
    if without_pulse:
        findings.append(about(path.name, "no servo pulse", count=without_pulse))
    if turned:
        findings.append(about(path.name, "reversed motors", thrusters=", ".join(turned)))
    begin = max(time[0] for time, _ in series.values())
    return series, [*findings, *_changes(path, parameters, begin)]


def _changes(path: Path, parameters: AutopilotParameters, begin: float) -> Iterator[Finding]:
    """Yield a finding for each time at which parameters that are used change, after the first command."""
    changed: dict[str, list[str]] = {}
    for name in sorted(parameters.used):
        times, told = parameters.told[name]
        for time in times[1:][np.diff(told) != 0.0] - begin:
            changed.setdefault(f"{time:.4g}", []).append(name)
    yield from (about(path.name, "parameter changed", name=listed(names), at=at) for at, names in changed.items())


def _are_pulses(path: Path, outputs: _Outputs) -> bool:
    """Return True for pulses in µs, False for fractions. Raises DataFileError where the numbers are neither."""
    values = np.nan_to_num(np.concatenate([values for _, values in outputs.series.values()]))
    low, high = PULSE_RANGE
    if outputs.rule.unit == "1" or (not outputs.rule.unit and (np.abs(values) <= 1.0).all()):
        return False
    if outputs.rule.unit or (np.isin(values, NO_OUTPUT) | ((low <= values) & (values <= high))).all():
        return True
    raise DataFileError(
        f"{path}, {shown(outputs.source.topic)}: outputs between {values.min():g} and {values.max():g} are neither "
        "fractions within -1 ... 1 nor pulses in us: name their unit in the table [topics] of rov.toml"
    )


def _range(
    number: int, time: Array, parameters: AutopilotParameters, keys: LogKeys, rest: float | None
) -> tuple[Array, Array, Array]:
    """Return the pulses of full thrust astern, of no thrust, and of full thrust ahead of an output, at some times.

    `rest` is the pulse of no thrust if the outputs tell it.
    """
    kind, servo = parameters.last("MOT_PWM_TYPE"), f"SERVO{number}"
    of_motors = [("MOT_PWM_MIN", "MOT_PWM_MAX")] if kind not in _BY_SERVO else []
    of_servo = [(f"{servo}_MIN", f"{servo}_MAX", f"{servo}_TRIM")] if kind in (None, *_BY_SERVO) else []
    is_trim = rest is not None and abs(rest - (parameters.last(f"{servo}_TRIM") or 0.0)) < _AT_REST
    usual = NEUTRAL if rest is None else rest
    neutral = np.full(len(time), usual if keys.neutral is None else keys.neutral)
    ranges = [*of_servo, *of_motors] if is_trim else [*of_motors, *of_servo]
    for names in ranges if keys.neutral is keys.span is None else ():
        if all((parameters.last(name) or 0.0) > 0.0 for name in names):
            low, high, *trim = (parameters.at(name, time) for name in names)
            if kind == _BY_SERVO[0]:  # with PWMRange, no thrust is in the middle
                return low, 0.5 * (low + high), high
            if trim and (is_trim or rest is None):
                return low, trim[0], high
            moved = neutral - NEUTRAL  # with its range, which the autopilot has about 1500 us
            return low + moved, neutral, high + moved
    span = keys.span or SPAN
    return neutral - span, neutral, neutral + span


def at_rest(
    file: str, pulses: Mapping[str, Array], trims: Mapping[str, float | None] = MappingProxyType({})
) -> tuple[dict[str, float], list[Finding]]:
    """Return the pulses of no thrust of outputs that clearly rest elsewhere than at 1500 us; and a finding, also where
    they only may.

    `pulses` has those of each output of the vehicle, and `trims` those of no thrust that the log tells, µs. A thruster
    that works all the time does not rest. But if most outputs stay at a pulse from which they depart to both sides, or
    which several have at the same time, and if none stays at 1500 us, then these are their pulses of no thrust.
    Otherwise a reverse thrust and a load would be invented. If one of them passes 1500 us now and then, this is not
    clear enough, and there is only a finding.
    """
    known = {name: values[np.isfinite(values) & ~np.isin(values, NO_OUTPUT)] for name, values in pulses.items()}
    levels = {name: level for name, values in known.items() if (level := _usual_level(values)) is not None}
    told = {name: level for name, level in levels.items() if abs(level - (trims.get(name) or 0.0)) < _AT_REST}
    if told and any(abs(level - NEUTRAL) >= _AT_REST for level in told.values()):
        return told, _tell_rest(file, "at rest", told)
    stays = {name: np.mean(np.abs(values - NEUTRAL) < _AT_REST) for name, values in known.items() if len(values)}
    if 2 * len(levels) <= len(pulses):
        return {}, []
    if max(stays.values()) >= _SELDOM:
        usual = {name: np.mean(known[name] == level) for name, level in levels.items()}
        is_brief = all(share < max(_SELDOM, _BRIEF * usual.get(name, 0.0)) for name, share in stays.items())
        return {}, _tell_rest(file, "perhaps at rest", levels) if is_brief else []
    sides = ((known[name].min() - level, known[name].max() - level) for name, level in levels.items())
    is_two_sided = any(low < -_CLEAR and high > _CLEAR for low, high in sides)
    own = [np.abs(pulses[name] - level) < _AT_REST for name, level in levels.items()]
    is_together = len(own) > 2 and len({*map(len, own)}) == 1 and np.mean(np.all(own, axis=0)) >= _SHARE
    if not (is_two_sided or is_together):
        return {}, _tell_rest(file, "perhaps at rest", levels)
    others = dict.fromkeys(pulses, next(iter(levels.values()))) if len({*levels.values()}) == 1 else {}
    return {**others, **levels}, _tell_rest(file, "at rest", levels)


def _usual_level(pulses: Array) -> float | None:
    """Return the most frequent pulse of an output, if it is near 1500 us and frequent enough to be where it rests."""
    levels, counts = np.unique(pulses, return_counts=True)
    if (
        not len(levels)
        or counts.max() < max(2.0, _SHARE * len(pulses))
        or abs(levels[counts.argmax()] - NEUTRAL) >= _REST
    ):
        return None
    return float(levels[counts.argmax()])


def _tell_rest(file: str, kind: str, levels: Mapping[str, float]) -> list[Finding]:
    """Return a finding with the pulses of no thrust, and one of them for a key of rov.toml."""
    texts = [f"{level:g}" for level in sorted({*levels.values()})]
    return [about(file, kind, rest=listed(texts), key=texts[0])]
