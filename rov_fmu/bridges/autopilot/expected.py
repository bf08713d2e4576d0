"""The expected results in the FMU of an autopilot, in the form of the standard FMI-LS-REF.

They are a flight of its vehicle. The solver in Python computes the motion, which the sensors tell. Python calls the law
in C for the commands, which the FMU must repeat. So the results test the binary, the interface and the order of the
variables, and not the law.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from rov_fmu.autopilot.gains import Autopilot
from rov_fmu.autopilot.law import AXES, PLACE, RATE, SENSORS, STICK
from rov_fmu.autopilot.pilot import Pilot
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import PITCH, ROLL, SURGE, SWAY, Declaration
from rov_fmu.fmu.archive import CARD, MANIFEST
from rov_fmu.fmu.reference_results import ExpectedRun, Values, as_written, expected_files
from rov_fmu.fmu.related import manifest
from rov_fmu.fmu.variables import FmuModel

_HELD = 5
"""The number of steps for which the sensors are held."""
_PHASES, _SAG = 10, 0.3
"""The number of times that the sensors are read for each kind of aim, and the part of the command that is lost last."""
_SAME_LAW = (
    "they come from the same law in C, compiled for a program that flew the vehicle when the FMU was built. So they "
    "test the interface and the compiled code, and not the law"
)
_DEPTH = 10.0
_AIMS = {"x": 0.3, "y": -0.2, "z": _DEPTH + 1.0, "phi": 0.1, "theta": -0.1, "psi": 1.0}


@dataclass(frozen=True)
class _Flight(ExpectedRun):
    """A flight of a vehicle, whose autopilot is what is tested."""

    commands: Sequence[tuple[float, Values]] = ()

    def references(self) -> list[tuple[float, Values]]:
        """Return the commands at the end of each phase."""
        return [*self.commands]


def expected_of_autopilot(autopilot: Autopilot, model: FmuModel) -> dict[str, bytes]:
    """Return the files with the expected results, and the model card, by their path in the FMU. Raises BuildError."""
    declared = {v.name: Declaration(v.unit, v.description) for v in model.variables}
    inputs = {v.name: declared[v.name] for v in model.variables if v.causality == "input"}
    flown = [*_flown(autopilot, [*inputs])]
    commands = {name: declared[name] for name in autopilot.vehicle.layout.commands}
    unit = 10.0 * autopilot.step
    flight = _Flight(
        "flight",
        "From the sticks to rates, to places and angles, and there with a battery that sags",
        *(autopilot.vehicle, unit, [(seen, [t]) for t, seen, _ in flown], inputs, commands),
        commands=[(t, given) for t, _, given in flown],
    )
    files, related = expected_files(f"Autopilot of {autopilot.vehicle.name}", [flight], _SAME_LAW)
    return {**files, MANIFEST: manifest(related), CARD: model.card.encode()}


def _flown(autopilot: Autopilot, names: Sequence[str]) -> Iterator[tuple[float, Values, Values]]:
    """Yield the end of each phase, the inputs that are held in it, and the commands at its end."""
    vehicle, pilot, h = autopilot.vehicle, Pilot(autopilot), autopilot.step
    memory, state, t = vehicle.memory(), {**vehicle.layout.at_rest}, 0.0
    state |= {"z": _DEPTH} if "z" in state else {}
    commands = dict.fromkeys(vehicle.layout.commands, vehicle.layout.command_of(0.0))
    others = vehicle.layout.usual_inputs
    for n, (kind, _) in enumerate(product((STICK, RATE, PLACE, PLACE), range(_PHASES)), 1):
        aims = {"sag": _SAG * (n > 3 * _PHASES)}
        for place, axis in zip(SENSORS, AXES, strict=False):
            if axis in autopilot.axes:
                mode = PLACE if axis in (ROLL, PITCH) or (kind == RATE and axis not in (SURGE, SWAY)) else kind
                pilot.modes[AXES.index(axis)] = mode
                aims |= {f"mode_{axis.velocity}": mode, f"ref_{place}": _AIMS[place]}
                aims |= {f"stick_{axis.velocity}": 0.3, f"ref_{axis.velocity}": 0.1}
                pilot.aims[AXES.index(axis)] = {STICK: 0.3, RATE: 0.1, PLACE: _AIMS[place]}[mode]
        told = {**state, **vehicle.calculated({**others, **commands}, state), **aims}
        seen = {name: as_written(told[name]) for name in names}
        attitude = {name: seen[name] for name in QUATERNION if name in seen}
        angles: dict[str, float] = {}
        if attitude:  # as the FMU computes them from what it is told
            computed = vehicle.calculated({**others, **commands}, {**state, **attitude})
            angles = {name: computed[name] for name in vehicle.layout.angles if name in computed}
        now = angles | seen
        for _ in range(_HELD):
            commands = pilot.step(now, h, 1.0 - seen["sag"])
        end = as_written(n * _HELD * h)
        yield end, seen, commands
        state = memory.step(vehicle, {**others, **commands}, state, t, end - t)
        t = end
