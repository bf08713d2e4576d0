"""A vehicle as the physics of ArduPilot's simulator: each servo packet moves it on by one frame, and gets a reply."""

import os
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count, takewhile
from math import cos, inf, pi, sin
from pathlib import Path
from socket import socket
from time import monotonic, thread_time
from typing import Any

import numpy as np

from rov_fmu.bridges.sitl_protocol import Address, PacketKind, Sequence, ServoPacket, reply, servo_packet
from rov_fmu.c.stepper import Stepper
from rov_fmu.equation.catalogue import GRAVITY, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.equation.words import AFLOAT, LEFT_WATER
from rov_fmu.io.columns import NO_OUTPUT, pulses
from rov_fmu.io.messages import InputError, listed
from rov_fmu.io.numbers import csv_of
from rov_fmu.io.output import Output, is_same, write_whole
from rov_fmu.tank.readers.ardusub_frames import Servos, impossible_of, motors_of, question_of
from rov_fmu.vehicle.vehicle import Vehicle

_LEAST_RATE = 20
"""The lowest frame rate, Hz. ArduPilot does not accept steps of 0.1 s or more."""
_LONGEST_RANGE = 100.0
"""The range of the sensor that measures the distance to the bottom, m."""
_DATAGRAM = 65536
_SILENCE = 5.0
"""The real time without a step after which the autopilot counts as silent, s. It repeats a packet after 1 s."""
_OTHERS = (
    "packets of other senders, such as {}, are ignored, because {} is followed. An autopilot that was started again is "
    f"followed when the old one has been silent for {_SILENCE:g} s"
)
_CLIPPED, _FOREIGN, _FOREIGN_TIME = 0.98, 0.05, 3.0
"""Motors above the first output may be clipped. Outputs that are farther than the second one from all that a frame
makes are those of another frame; that is told after this time, s."""
_LATE = 1.0
"""The time of the simulation for which servos must not fit before it is said, s."""
MOST_LOGS = 20
"""The largest number of logs of one run."""
MOST_ROWS = 1_000_000
"""The largest number of rows in the logs of one run, which take about 150 MB."""
_FULL = f"a run has {MOST_LOGS} logs with {MOST_ROWS:,} rows in all at most: the rest is not logged"
_usual_fraction = pulses()
_MOTION = ("u", "v", "w", "p", "q", "r", "x", "y", "z", "phi", "theta", "psi")
_RATES = ("u", "v", "w", "x", "y", "z")
"""The variables whose derivatives the reply contains. Those of the position are the velocity over ground."""
_CURRENT = "electric_current"
_LOGGED = {
    "surge velocity [m/s]": SURGE,
    "sway velocity [m/s]": SWAY,
    "depth [m]": HEAVE,
    "roll [rad]": ROLL,
    "pitch [rad]": PITCH,
    "heading [rad]": YAW,
}
"""The columns of a log, and the axis that the vehicle must have."""


@dataclass(frozen=True)
class Setup:
    """What a flight begins with."""

    vehicle: Vehicle
    servos: Servos
    start: Mapping[str, float] = field(default_factory=dict)
    """Inputs that are held, states and Euler angles at the start, in SI units, by name."""
    bottom: float = inf
    """The depth of the bottom, m."""
    log: Path | None = None
    """The log to write: a table (CSV) that `identify` reads. Later flights add a number to its name."""
    log_interval: float = 0.1
    """The time between two rows of the log, s."""
    force: bool = False
    """True if logs may replace files that exist."""
    frame: str = ""
    """The frame of ArduSub whose motors the servos are, if it is one."""


class FlightLog:
    """A log of one flight: a table in the form that `identify` reads.

    The table has commands, velocities over ground, depth and angles. A row holds the motion at its time, and the mean
    commands up to the next row.
    """

    def __init__(self, setup: Setup, most_rows: int) -> None:
        """Begin a log, whose rows end after the first `most_rows`."""
        layout = setup.vehicle.layout
        self._interval, self._most_rows = setup.log_interval, most_rows
        self._motion = [title for title, axis in _LOGGED.items() if layout.has(axis)]
        self._titles = ["time [s]", *(f"{name} [1]" for name in layout.commands), *self._motion]
        self._rows = array("d")
        self._number_of_commands = len(layout.commands)
        self._begin_row([])

    def _begin_row(self, row: list[float]) -> None:
        self._row, self._sums, self._since = row, [0.0] * self._number_of_commands, 0.0

    def add(self, h: float, fractions: list[float], time: float, motion: Mapping[str, float]) -> None:
        """Add a step of h seconds under commands from -1 to 1, and the time and the motion at its end."""
        self._sums = [total + h * value for total, value in zip(self._sums, fractions, strict=True)]
        self._since += h
        if self._row and self._since < self._interval - 0.5 * h:
            return
        if self._row and self.rows < self._most_rows:
            self._rows.extend([self._row[0], *(total / self._since for total in self._sums), *self._row[1:]])
        self._begin_row([time, *(motion[title] for title in self._motion)])

    @property
    def rows(self) -> int:
        """The number of complete rows."""
        return len(self._rows) // len(self._titles)

    def write(self, path: Path) -> dict[Path, str]:
        """Write all complete rows, and return what the file replaced. Raises WriteError."""
        width = len(self._titles)
        rows = (self._rows[first : first + width] for first in range(0, len(self._rows), width))
        return write_whole(Output(path, csv_of(self._titles, rows, "{:.9g}".format).encode()), force=True)


class Outputs:
    """Which servos have pulses: those that the vehicle needs, and those that follow them and move.

    ArduSub sends 1500 µs to servos 1 to 8 while it starts, for 1.8 s. Then those without a function have no pulse, and
    others have their own pulse at rest.
    """

    def __init__(self, servos: Servos, motors: int, frame: str = "") -> None:
        """Begin without any pulse. ArduSub may drive so many motors, of which a vehicle may lack the last ones.

        `frame` is the one that it must have, if the servos are those of a frame.
        """
        self._impossible, self._foreign_time = impossible_of(frame), 0.0
        """Directions of outputs that no demands of the frame give, and the time with such outputs, s."""
        self._drives = {number: name for name, (number, _) in servos.items()}
        self._last = max([*self._drives, motors])
        self._silences = dict.fromkeys(self._drives, 0.0)
        """For each servo of the vehicle, the time since its last pulse during which another servo had one, s."""
        self._pulses: dict[int, int] = {}
        """The last pulse of each servo after those of the vehicle, µs."""
        self._changes: Counter[int] = Counter()
        """How often these pulses have changed."""
        self._moving_time = 0.0
        """The time since one of these servos moved, s."""

    def add(self, h: float, pulses: tuple[int, ...]) -> None:
        """Add a step of h seconds."""
        if all(pulse in NO_OUTPUT for pulse in pulses):
            return
        outputs = np.array([_usual_fraction(pulse) for pulse in pulses[: self._impossible.shape[1]]])
        if len(self._impossible) and np.abs(outputs).max() < _CLIPPED:
            self._foreign_time += h * (np.abs(self._impossible @ outputs).max() > _FOREIGN)
        for number, silence in self._silences.items():
            self._silences[number] = silence + h if pulses[number - 1] in NO_OUTPUT else 0.0
        for number, pulse in enumerate(pulses[self._last :], self._last + 1):
            if pulse not in NO_OUTPUT:
                self._changes[number] += pulse != self._pulses.get(number, pulse)
                self._pulses[number] = pulse
        self._moving_time += h if any(map(self._moves, self._changes)) else 0.0

    def _moves(self, number: int) -> bool:
        """Return whether a servo moves. The first change may be the one at the end of ArduSub's start."""
        return self._changes[number] > 1

    def doubts(self, *, at_end: bool = False) -> Iterator[tuple[str, ...]]:
        """Yield words and what they need, if the autopilot drives fewer or more servos than the vehicle has."""
        least = 0.0 if at_end else _LATE
        if silent := sorted(number for number, silence in self._silences.items() if silence > least):
            yield "no pulses come to {} ({})", _numbered(silent), listed(self._drives[number] for number in silent)
        if self._moving_time > least and (extra := [*takewhile(self._moves, count(self._last + 1))]):
            yield "the pulses of {} change, but no thruster of the vehicle follows them", _numbered(extra)
        if self._foreign_time > _FOREIGN_TIME:
            yield ("no demands give these pulses together",)


def _numbered(servos: list[int]) -> str:
    return f"servo{'s' if len(servos) > 1 else ''} {listed(map(str, servos))}"


class Flight:
    """One flight: a vehicle that follows the servo packets of an autopilot."""

    def __init__(self, setup: Setup, most_rows: int) -> None:
        """Begin at time 0 s, with a log of at most so many rows. Raises BuildError when there is no engine."""
        self._setup, layout = setup, setup.vehicle.layout
        self._names = [name for name in _MOTION if name in layout.state or name in layout.angles]
        self._names += [f"der({name})" for name in _RATES if name in layout.state]
        self._names += [_CURRENT] if _CURRENT in layout.electric else []
        self._stepper = Stepper(setup.vehicle, setup.start, self._names)
        self._commands = {name: setup.servos.get(name) for name in layout.commands}
        self.is_above = False
        """True when the vehicle is above the surface, which its model does not have."""
        self.outputs = Outputs(setup.servos, motors_of(layout), setup.frame)
        self._held = {**layout.usual_inputs, **setup.start}
        self.log = FlightLog(setup, most_rows) if setup.log and most_rows else None

    @property
    def time(self) -> float:
        """The time since the start, s."""
        return self._stepper.time

    def step(self, packet: ServoPacket) -> bytes:
        """Move on by one frame and return the reply. Raises InputError if the motion cannot be computed."""
        h, layout = 1.0 / max(packet.frame_rate, _LEAST_RATE), self._setup.vehicle.layout
        commands, fractions = [], []
        for name, servo in self._commands.items():
            if servo is None:
                commands.append(self._held[name])
                fractions.append(layout.fraction_of(self._held[name]))
            else:
                number, sign = servo
                fractions.append(sign * self._fraction(packet.pulses[number - 1]))
                commands.append(layout.command_of(fractions[-1]))
        try:
            at = dict(zip(self._names, self._stepper.step(commands, h), strict=True))
        except OverflowError as error:
            raise InputError(f"VEHICLE: {error}") from error
        self.is_above = layout.has_only_water and at["z"] < -AFLOAT
        self.outputs.add(h, packet.pulses)
        values, motion = self._measured(at)
        if battery := self._battery(at):
            values["battery"] = battery
        if self.log:
            self.log.add(h, fractions, self.time, at | motion)
        return reply(values)

    def _fraction(self, pulse: int) -> float:
        """Return the command from -1 to 1 of a pulse (µs), by the vehicle's own pulses if it has them."""
        layout = self._setup.vehicle.layout
        if layout.pulse and pulse not in NO_OUTPUT:
            return layout.fraction_of(pulse)
        return max(-1.0, min(1.0, _usual_fraction(pulse)))

    def _battery(self, at: Mapping[str, float]) -> dict[str, float]:
        """Return the voltage and the electric current of the battery, as far as the vehicle has them."""
        voltages = [table.voltage for curve in self._setup.vehicle.layout.curves if (table := curve.electric_current)]
        voltage = self._held.get("voltage", next(iter(voltages), None))
        battery = {} if voltage is None else {"voltage": voltage}
        return battery | ({"current": at[_CURRENT]} if voltages else {})

    def _measured(self, at: Mapping[str, float]) -> tuple[dict[str, Any], dict[str, float]]:
        """Return the values of the reply, and those of the log, from the variables of the vehicle."""
        u, v, w, p, q, r, x, y, z, phi, theta, psi = (at.get(name, 0.0) for name in _MOTION)
        du, dv, dw, V_N, V_E, V_D = (at.get(f"der({name})", 0.0) for name in _RATES)
        c1, s1, c2, s2, c3, s3 = cos(phi), sin(phi), cos(theta), sin(theta), cos(psi), sin(psi)
        upright = c1 * c2  # the part of the body's z axis that points down
        # The current is steady, so the acceleration of the vehicle is that of its motion through the water.
        accel = [
            du + q * w - r * v + GRAVITY * s2,
            dv + r * u - p * w - GRAVITY * s1 * c2,
            dw + p * v - q * u - GRAVITY * upright,
        ]
        values: dict[str, Any] = {
            "timestamp": self.time,
            "imu": {"gyro": [p, q, r], "accel_body": accel},
            "position": [x, y, z],
            "attitude": [phi, theta, (psi + pi) % (2.0 * pi) - pi],
            "velocity": [V_N, V_E, V_D],
        }
        if self._setup.bottom < inf:
            height = max(self._setup.bottom - z, 0.0)
            values["rng_1"] = height / upright if height < _LONGEST_RANGE * upright else _LONGEST_RANGE
        ahead, starboard = c3 * V_N + s3 * V_E, c3 * V_E - s3 * V_N
        below = s2 * ahead + c2 * V_D
        over_ground = (c2 * ahead - s2 * V_D, c1 * starboard + s1 * below)
        return values, dict(zip(_LOGGED, (*over_ground, z, phi, theta, psi), strict=True))


@dataclass
class Traffic:
    """What a connection has seen."""

    frames: int = 0
    """The number of steps."""
    repeated: int = 0
    """The number of packets that got the last reply again."""
    ignored: int = 0
    """The number of datagrams that were no servo packets, came late, or came from another sender."""
    restarts: int = 0
    own_time: float = 0.0
    """The processor time from the arrivals of servo packets to the ends of their replies, s."""


class SitlConnection:
    """The flights of a vehicle with one autopilot, which may be started again."""

    def __init__(
        self, setup: Setup, hint: Callable[[str], None] = lambda _: None, clock: Callable[[], float] = monotonic
    ) -> None:
        """Begin the first flight. Raises BuildError when there is no engine.

        `hint` is called with words for the user, at most once about each matter. `clock` is the real time, s.
        """
        self._setup, self._hint, self._clock = setup, hint, clock
        self._hinted: set[str] = set()
        self._question = question_of(setup.vehicle.layout)
        self._answer = b""
        self._sender: Address | None = None
        self._last_step = clock()
        self._passed = 0.0
        """The time of the flights that have ended, and of the silences between them, s."""
        self.order = Sequence()
        self.traffic = Traffic()
        self.logs: dict[Path, str] = {}
        """The logs that are written, each with what it replaced."""
        self._number = 0
        """The number in the name of the last log."""
        self._rows = 0
        self.flight = self._begin()

    def _begin(self) -> Flight:
        """Return a new flight. It has no log if the run has as many logs or rows as it may have."""
        rows = MOST_ROWS - self._rows if len(self.logs) < MOST_LOGS else 0
        if self._setup.log and not rows:
            self._say_once(_FULL)
        return Flight(self._setup, rows)

    def answer(self, data: bytes, sender: Address) -> bytes:
        """Return the reply to a datagram; it is empty if there is none.

        Raises InputError if the motion cannot be computed, and WriteError if the log cannot be written.
        """
        packet = servo_packet(data)
        kind = self._kind(packet, sender) if packet else PacketKind.STRANGE
        if packet is None or kind is PacketKind.STRANGE:
            self.traffic.ignored += 1
            return b""
        if kind is PacketKind.REPEATED:
            self.traffic.repeated += 1
            return self._answer
        self._passed += self._silence()
        self._last_step = self._clock()
        if kind is PacketKind.RESTART:
            self._passed += self.flight.time
            self.end()
            self.traffic.restarts += 1
            self.flight = self._begin()
        self.traffic.frames += 1
        self._answer = self.flight.step(packet)
        if self.flight.is_above:
            self._say_once(LEFT_WATER, f"{self.flight.time:.1f}")
        self._doubt()
        return self._answer

    def _doubt(self, *, at_end: bool = False) -> None:
        """Say which servos do not fit the vehicle."""
        for words, *values in self.flight.outputs.doubts(at_end=at_end):
            self._say_once(f"{words}: {self._question}", *values)

    def _kind(self, packet: ServoPacket, sender: Address) -> PacketKind:
        """Return what to do with a packet. Only the first sender is followed.

        When it is silent, another one from the same host is the autopilot that was started again.
        """
        if self._sender is None or sender == self._sender:
            kind = self.order.kind(packet)
        elif sender[0] == self._sender[0] and self._silence() and packet.is_plausible:
            self.order.restart()
            self.order.kind(packet)
            kind = PacketKind.RESTART
        else:
            other, own = (f"{host}:{port}" for host, port, *_ in (sender, self._sender))
            self._say_once(_OTHERS, other, own)
            return PacketKind.STRANGE
        if kind is not PacketKind.STRANGE:
            self._sender = sender
        return kind

    def _say_once(self, words: str, *values: str) -> None:
        if words not in self._hinted:
            self._hinted.add(words)
            self._hint(words.format(*values))

    def _silence(self) -> float:
        """Return the real time since the last step, s, or 0 if it is too short to be a silence."""
        silence = self._clock() - self._last_step
        return silence if silence >= _SILENCE else 0.0

    def _time(self) -> float:
        """Return the time since the start, s: that of all flights, and the real time of silences."""
        silence = self._silence() if self._sender else self._clock() - self._last_step
        return self._passed + self.flight.time + silence

    def end(self) -> None:
        """End the flight: say what is left to say, and write its log. Raises WriteError."""
        if self.flight.time:
            self._doubt(at_end=True)
        self.write_log()

    def write_log(self) -> None:
        """Write the log of the flight, if it has a complete row, under a name that is free. Raises WriteError."""
        log, path = self.flight.log, self._setup.log
        if not (log and path and log.rows):
            return
        while True:
            self._number += 1
            numbered = path if self._number == 1 else path.with_stem(f"{path.stem}_{self._number}")
            is_read = any(is_same(numbered, file) for file in self._setup.vehicle.files)
            if not is_read and (self._setup.force or not os.path.lexists(numbered)):
                break
        self.logs |= log.write(numbered)
        self._rows += log.rows
        if self._rows >= MOST_ROWS:
            self._say_once(_FULL)

    def serve(self, server: socket, duration: float = inf) -> None:
        """Answer the datagrams that arrive, until a duration has passed since the start, s.

        A reply that cannot be sent is lost, and ArduPilot asks again. Raises what `answer` raises.
        """
        port = server.getsockname()[1]
        while (left := duration - self._time()) > 1e-6:  # the time is a sum of steps, with their rounding
            server.settimeout(min(left, _SILENCE))
            try:
                data, sender = server.recvfrom(_DATAGRAM)
            except TimeoutError:
                self._say_once("waiting for packets of ArduSub to UDP port {}: start it with --model JSON", str(port))
                continue
            except ConnectionError:  # Windows reports in this way that nobody received the last reply
                continue
            begin = thread_time()
            if answer := self.answer(data, sender):
                with suppress(OSError):
                    server.sendto(answer, sender)
            self.traffic.own_time += thread_time() - begin
