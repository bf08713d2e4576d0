"""The command `rov-fmu sitl`: the meaning of its options, and what it prints."""

import os
from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, socket
from typing import Any

import numpy as np

from rov_fmu.bridges.sitl import Setup, SitlConnection
from rov_fmu.c.stepper import Stepper
from rov_fmu.equation.catalogue import HEAVE, ROLL
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import FAINT
from rov_fmu.interface.arguments import checked_start, checked_values, with_axes
from rov_fmu.interface.model import load
from rov_fmu.interface.simulate_command import with_settings
from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import InputError, did_you_mean, print_message, shown
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.report.console import console, paragraph, print_end, shell_words
from rov_fmu.tank.readers.ardusub_frames import FRAMES, Servos, chosen_frame, config_of, servos_of
from rov_fmu.vehicle.steady import beyond_stated

_WITHOUT_POSITION = 45.0
"""The time after which ArduSub knows its position, s."""
_FAR = 0.1
"""A rise that matters, m."""
_PARAMETERS = (".parm", ".param")
"""How the name of a file of ArduPilot's parameters ends."""
_MOST_CHANNELS = 16
"""ArduPilot sends 32 channels only if it is told to, so a servo is one of the first 16."""


def serve(path: Path, *, host: str, port: int, duration: float | None, parameters: Path | None, **flight: Any) -> None:
    """Answer an autopilot until the duration (s) is over or the command is interrupted, and then write the log.

    `parameters` is a file of parameters to write for ArduSub. `flight` has the other options, which `_setup` describes.
    Raises FileError, InputError about an option, WriteError about a file, and BuildError.
    """
    if parameters and parameters.suffix not in _PARAMETERS:
        raise InputError(f"--parameters {parameters}: the name must end with {' or '.join(_PARAMETERS)}")
    setup, frame = _setup(path, **flight)
    if parameters:
        needed = _parameters(frame, rolls_alone=_rolls_alone(setup))
        _check_free("--parameters", parameters, [path, *setup.vehicle.files], force=setup.force)
        write_whole(Output(parameters, needed.encode()), force=True)
    with socket(AF_INET, SOCK_DGRAM) as server:
        try:
            server.bind((host, port))
        except OSError as error:
            raise InputError(f"--host {host}, --port {port}: cannot listen there: {error.strerror}") from error
        connection = SitlConnection(setup, lambda words: print_message(f"rov-fmu: {words}"))
        address, port = server.getsockname()
        for line in _listed(setup.servos, setup.vehicle.layout):
            paragraph(console(), line)
        if frame:
            paragraph(console(), f"ArduSub must have {config_of(frame)}")
        if _rolls_alone(setup):
            print_message(f"rov-fmu: {_NO_ROLL}")
        for words in beyond_stated(setup.vehicle):
            print_message(f"rov-fmu: {words}")
        if floats := _floats(setup):
            print_message(f"rov-fmu: {floats}")

        def end() -> None:
            connection.end()
            paragraph(console(), _summary(connection))
            if connection.logs:
                inspect = shell_words("rov-fmu", "inspect", next(iter(connection.logs)))
                print_end(connection.logs, inspect)
            elif setup.log:
                paragraph(console(), "No log was written, because no row was complete.")

        with cleaned_up(end, ends_usually=True):
            paragraph(console(), f"listening on {address}, UDP port {port}; Ctrl-C ends it")
            connection.serve(server, duration or inf)


def _setup(
    path: Path,
    *,
    frame: str | None,
    servos: Sequence[str],
    settings: Sequence[str],
    bottom: float,
    log: Path | None,
    log_rate: float,
    force: bool,
) -> tuple[Setup, str]:
    """Return the setup of a flight, and the frame of its servos, if any.

    - `servos`, `settings`: texts such as `3=t`, or `3=-t` for a reversed thruster, and `V_N=0.3`.
    - `bottom`: its depth, m.
    - `log_rate`: the rows of the log per second.

    Raises FileError, InputError, WriteError.
    """
    if log and log.suffix.lower() != ".csv":
        raise InputError(f"--log {log}: the name must end with .csv")
    if frame is not None and frame not in FRAMES:
        hint = did_you_mean(frame, FRAMES)
        raise InputError(f"--frame {shown(frame)}: must be one of {', '.join(FRAMES)}{hint}")
    vehicle, given = with_settings(load(path), settings)
    if not vehicle.layout.commands:
        raise InputError(f"{path}: this vehicle has no thrusters, so there is nothing that ArduSub could drive")
    if log:
        _check_free("--log", log, [path, *vehicle.files], force=force)
    inputs = with_axes(vehicle.layout, {name: np.array(value) for name, value in given.inputs.items()})
    checked_values("inputs", inputs, vehicle.layout.inputs, many=False)
    checked_start(given.start, vehicle.layout, many=False)
    chosen = vehicle.layout, frame, _table(servos, vehicle.layout)
    driven = servos_of(*chosen)
    for name in inputs:
        if name in driven:
            raise InputError(f"--set {name}: servo {driven[name][0]} drives this input")
    start = {name: float(value) for name, value in inputs.items()} | given.start
    fitting = chosen_frame(*chosen)
    own = "" if servos else fitting
    return Setup(vehicle, driven, start, bottom, log, 1.0 / log_rate, force, own), fitting


def _check_free(option: str, path: Path, inputs: Sequence[Path], *, force: bool) -> None:
    """Raise InputError if a file that an option names exists, unless it is to be replaced, or is one of the inputs."""
    check_targets([(path, "")], inputs, force=True)
    if os.path.lexists(path) and not force:
        raise InputError(f"{option} {path}: the file exists; choose another name, or replace it with --force")


def _table(texts: Sequence[str], layout: Layout) -> dict[int, str]:
    """Return the names of inputs by servo. Raises InputError."""
    names: dict[int, str] = {}
    example = next(iter(layout.commands)).removeprefix("u_")
    for text in texts:
        number, equals, name = (part.strip() for part in text.partition("="))
        if not (equals and number.isdecimal() and 1 <= int(number) <= _MOST_CHANNELS):
            raise InputError(f"--servo {text}: must be N=NAME with N from 1 to {_MOST_CHANNELS}, such as 3={example}")
        if int(number) in names:
            raise InputError(f"--servo {text}: servo {number} is given before")
        names[int(number)] = name
    return names


def _listed(servos: Servos, layout: Layout) -> Iterator[str]:
    """Yield a line about what each servo drives, by the words of the input: `servo 1 drives u_l: left thruster ...`."""
    for name, (number, sign) in sorted(servos.items(), key=lambda item: item[1]):
        words = layout.commands[name].description.removeprefix("Command ").partition(";")[0]
        yield f"servo {number} drives {words}{', reversed' if sign < 0 else ''}"


def _rolls_alone(setup: Setup) -> bool:
    """Return True if the autopilot tries to roll a vehicle that has no roll."""
    layout = setup.vehicle.layout
    driven = [t for t in layout.thrusters if f"u_{t.name}" in setup.servos]
    return not layout.has(ROLL) and any(abs(t.effect(ROLL)) > FAINT and t.effect(HEAVE) for t in driven)


def _parameters(frame: str, *, rolls_alone: bool) -> str:
    """Return the parameters with which ArduSub flies the vehicle, for `sim_vehicle.py --add-param-file`."""
    own = " ".join(config_of(frame).split()[:2]) if frame else ""
    lines = (own, "BARO_SPEC_GRAV 1.0264", "SIM_RATE_HZ 400", "ATC_RAT_RLL_I 0" if rolls_alone else "")
    return "".join(f"{line}\n" for line in lines if line)


_NO_ROLL = (
    "this vehicle has no roll, so ArduSub's roll integrator winds up: its vertical thrusters push against each other "
    "with up to 18 %. ATC_RAT_RLL_I 0 prevents it"
)


def _floats(setup: Setup) -> str:
    """Return a sentence about a vehicle that rises without commands; an empty text if it does not."""
    vehicle, layout = setup.vehicle, setup.vehicle.layout
    if not layout.has(HEAVE):
        return ""
    stepper = Stepper(vehicle, setup.start, ["z"])
    (start,), (end,) = stepper.recorded(), stepper.step([], _WITHOUT_POSITION)
    weight = vehicle.alone(HEAVE, {**layout.usual_inputs, **setup.start}).C
    weight *= vehicle.effective_inertia(HEAVE)
    if weight >= 0.0 or start - end < _FAR:
        return ""
    return (
        f"this vehicle rises with {-weight:.2g} N: {start - end:.2g} m in the {_WITHOUT_POSITION:g} s before ArduSub "
        "knows its position. Start deeper (--set z), or arm at once"
    )


def _summary(connection: SitlConnection) -> str:
    """Return a line about the traffic and the time that it took."""
    traffic, order = connection.traffic, connection.order
    own = 1e6 * traffic.own_time / max(traffic.frames + traffic.repeated, 1)
    return (
        f"{connection.flight.time:.3f} s of flight; {traffic.frames} frames, {own:.0f} µs each; "
        f"{traffic.repeated} repeated, {order.lost} lost, {traffic.ignored} ignored, {traffic.restarts} restarts"
    )
