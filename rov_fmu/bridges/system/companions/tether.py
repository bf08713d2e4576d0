"""A tether between two points, as a PythonFMU slave: MoorDyn's chain of masses and springs in flowing water.

Each end is a port: place and velocity over ground go in, and the force that the tether exerts there comes out. An end
that is not connected stays where it starts. The tether hangs at rest when the first step begins, and pulls from the
second step on. Places are north, east and down from the surface; in MoorDyn x is north, y west, z up.

The water flows with the profile of a current, and with the waves that a seaway tells at each node, for the middle of
the step. MoorDyn takes the force of Froude and Krylov along and across the line, and of the added mass across it.

The seabed pushes with GROUND for each metre of depth and diameter, and damps as much as brings a node to rest soonest:
MoorDyn's own damping is so large that a node would need some 100 times smaller substeps.
"""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import ceil, hypot, pi, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

from pythonfmu.enums import Fmi2Status

from rov_fmu.bridges.system.companions._common import (
    ACCELERATION,
    DIRECTIONS,
    VELOCITY,
    Companion,
    Variables,
    at,
    profile,
)

SEGMENTS, SHOWN = 20, 11  # of the line, the points of its shape
NODES = SEGMENTS + 1
SUBSTEP = 0.2  # of the time in which a wave of tension passes a segment: twice as much can be unstable
GROUND = 1e5  # stiffness of the seabed, Pa/m
DEPTH = 100.0  # of the seabed, where nothing tells it, m
ENDS = {"top": "upper", "bottom": "lower"}
AXES = (("N", "x", "north"), ("E", "y", "east"), ("D", "z", "down"))

# name: causality, start, unit, description
VARIABLES: Variables = {
    "length": ("input", 60.0, "m", "Length without tension, to which it is paid out or hauled in"),
    "paid": ("output", 60.0, "m", "Length without tension that hangs out"),
    "reel_speed": ("parameter", 1.0, "m/s", "Largest speed of paying out and hauling in"),
    "shortest": ("parameter", 0.0, "m", "Length to which it can be hauled in; 0: the length at the start"),
    "diameter": ("parameter", 0.0076, "m", "Diameter"),
    "mass": ("parameter", 0.0465, "kg/m", "Mass over length; 0.0465 floats with the default diameter"),
    "EA": ("parameter", 2e4, "N", "Stiffness: tension over strain"),
    "C_d": ("parameter", 1.2, "1", "Drag coefficient across the tether"),
    "C_d_along": ("parameter", 0.02, "1", "Drag coefficient along the tether"),
    "rho": ("parameter", 1025.0, "kg/m3", "Density of the water"),
    "seabed": ("parameter", 0.0, "m", f"Depth of the seabed; 0: of the lowest level, or {DEPTH:g} m without levels"),
}
for end, words in ENDS.items():
    VARIABLES |= {f"F_{d}_{end}": ("output", 0.0, "N", f"Force at the {words} end, positive {to}") for d, _, to in AXES}
    VARIABLES |= {f"{x}_{end}": ("input", 0.0, "m", f"Position of the {words} end, {to}") for _, x, to in AXES}
    VARIABLES |= {f"vg_{d}_{end}": ("input", 0.0, "m/s", f"Velocity of the {words} end, {to}") for d, _, to in AXES}
    VARIABLES[f"tension_{end}"] = ("output", 0.0, "N", f"Size of the force at the {words} end")
    about = f"The velocity of the {words} end is the change of its position, and vg is not read"
    VARIABLES[f"difference_{end}"] = ("parameter", False, "1", about)
VARIABLES |= {
    f"{x}_{n}": ("output", 0.0, "m", f"Shape: {to}, {n}/{SHOWN - 1} along from the upper end")
    for n in range(SHOWN)
    for _, x, to in AXES
}
WAVES: Variables = {
    f"{name}_p{n}": ("input", 0.0, unit, f"{what} of the water in waves at node {n} from the upper end, {to}")
    for n in range(NODES)
    for names, unit, what in ((VELOCITY, "m/s", "Velocity"), (ACCELERATION, "m/s2", "Acceleration"))
    for name, to in zip(names, DIRECTIONS, strict=True)
}
PLACES: Variables = {
    f"{x}_p{n}": ("output", 0.0, "m", f"Position of node {n} from the upper end, {to}")
    for n in range(NODES)
    for _, x, to in AXES
}
"""What a tether has in a plan where its terminal `waves` is connected."""


FILE = """tether
--- LINE TYPES ---
TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx
(name) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)
tether {diameter} {mass} {EA} -0.8 0.0 {C_d} 1.0 {C_d_along} 0.0
--- POINTS ---
Node Type X Y Z M V CdA CA
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled {ends[0]} {ends[1]} {ends[2]} 0 0 0 0
2 Coupled {ends[3]} {ends[4]} {ends[5]} 0 0 0 0
--- LINES ---
Line LineType NodeA NodeB UnstrLen NumSegs Outputs
(-) (-) (-) (-) (m) (-) (-)
1 tether 1 2 {length} {segments} -
--- OPTIONS ---
{substep} dtM
1 disableOutput
{ground} WtrDpth
{stiffness} kBot
{damping} cBot
{rho} rho
1 WaveKin
--- END ---
"""


@contextmanager
def without_output() -> Iterator[None]:
    """Keep what MoorDyn prints before it can be told not to out of the importer's output."""
    try:
        kept = os.dup(1)
    except OSError:  # the importer has no output
        yield
        return
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        if sys.stdout:
            sys.stdout.flush()
        os.dup2(null, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(null)
        os.close(kept)


class Tether(Companion):
    """The slave."""

    description = "A tether between two points in flowing water (MoorDyn)"
    needs = "moordyn"
    points = tuple(ENDS)
    nodes = NODES
    length: float
    reel_speed: float
    limits: ClassVar = {
        "length": (0.01, 1e6),
        "reel_speed": (0.0, 100.0),
        "shortest": (0.0, 1e6),
        "diameter": (1e-4, 10.0),
        "mass": (1e-4, 1e4),
        "EA": (1.0, 1e12),
        "C_d": (0.0, 100.0),
        "C_d_along": (0.0, 100.0),
        "rho": (0.0, 1e4),
        "seabed": (0.0, 1e6),
    }

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.system: object = None
        self.history: list[list[float]] = []
        self.reeling = False
        self.levels = profile(self.shape.get("levels", 0), "input")
        self.terminals = [("profile", [*self.levels], ())]
        variables = VARIABLES | self.levels
        if self.shape.get("waves"):
            self.terminals += [("pose", [*PLACES], ()), ("waves", [*WAVES], ())]
            variables |= PLACES | WAVES
        self.told = range(NODES if self.shape.get("waves") else 0)
        self.register(variables, "fixed")

    def exit_initialization_mode(self) -> None:
        """Tell the length at the start, before the tether is made."""
        self.paid = self.length

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Hold the velocities of the ends for a step. A step that MoorDyn cannot do is refused."""
        # Steps of an importer that counts in ns differ in their last bits: MoorDyn would do one substep more or less.
        t, h = round(current_time, 9), round(step_size, 9)
        places = self._of_ends("xyz", "{}_{}")
        levels = self._levels()
        try:
            if self.system is None:
                self._begin(places, levels, h)
            own, moordyn = self.__dict__, self.moordyn
            line = moordyn.GetLine(self.system, 1)
            self._reel(line, h)
            nodes = moordyn.ExternalWaveKinGetCoordinates(self.system)  # those of the line, then of the ends
            water, acceleration = [turned(at(levels, -z)) for _, _, z in nodes], [[0.0, 0.0, 0.0] for _ in nodes]
            for n in self.told:
                waves = self._of_water(VELOCITY, n)
                water[n] = [steady + wave for steady, wave in zip(water[n], waves, strict=True)]
                acceleration[n] = self._of_water(ACCELERATION, n)
            moordyn.ExternalWaveKinSet(self.system, water, acceleration, t)
            forces = moordyn.Step(self.system, places, self._velocities(places, h), t, h)
        except (ImportError, RuntimeError, ValueError) as error:
            self.log(f"MoorDyn: {error}", Fmi2Status.error)
            return False
        for n, end in enumerate(ENDS):
            F = turned(forces[3 * n : 3 * n + 3])
            own |= {f"F_{d}_{end}": x for (d, _, _), x in zip(AXES, F, strict=True)} | {f"tension_{end}": hypot(*F)}
        for numbers, apart, mark in ((range(SHOWN), SEGMENTS // (SHOWN - 1), ""), (self.told, 1, "p")):
            for n in numbers:
                at_node = turned(moordyn.GetLineNodePos(line, n * apart))
                own |= {f"{x}_{mark}{n}": value for (_, x, _), value in zip(AXES, at_node, strict=True)}
        return True

    def terminate(self) -> None:
        """End MoorDyn."""
        if self.system is not None:
            self.moordyn.Close(self.system)

    def _begin(self, ends: list[float], levels: list[list[float]], h: float) -> None:
        """Find the tether at rest between its ends."""
        import moordyn

        self.moordyn = moordyn
        self.check()
        own = self.__dict__
        ground = own["seabed"] or levels[-1][0] or DEPTH
        for n, end in enumerate(ENDS.values()):
            if -ends[3 * n + 2] > ground:
                words = f"the {end} end begins {-ends[3 * n + 2]:.4g} m deep, below the seabed at {ground:.4g} m"
                self.log(words, Fmi2Status.warning)
        moved = own["mass"] + own["rho"] * pi / 4.0 * own["diameter"] ** 2  # with the water that moves across, kg/m
        stiffness = GROUND * own["diameter"]
        self.paid = own["length"]
        self.least = min(own["shortest"] or self.paid, self.paid)
        times = self.least / SEGMENTS * sqrt(own["mass"] / own["EA"]), sqrt(moved / stiffness)
        file_of = {
            "ends": ends,
            "segments": SEGMENTS,
            "substep": h / ceil(h / (SUBSTEP * min(times))),
            "ground": ground,
            "stiffness": GROUND,
            "damping": 2.0 * sqrt(stiffness * moved) / own["diameter"],
        }
        with TemporaryDirectory() as folder:
            file = Path(folder, "tether.txt")
            file.write_text(FILE.format(**own, **file_of), encoding="utf-8")
            with without_output():
                self.system = moordyn.Create(str(file))
                moordyn.SetVerbosity(self.system, moordyn.LEVEL_NONE)
                moordyn.Init(self.system, ends, [0.0] * 6)
        moordyn.ExternalWaveKinInit(self.system)

    def _reel(self, line: object, h: float) -> None:
        """Pay out or haul in for a step, at most as fast as the reel turns. The whole line grows or shrinks."""
        change = max(self.length, self.least) - self.paid
        change = min(max(change, -self.reel_speed * h), self.reel_speed * h)
        if change or self.reeling:
            self.moordyn.SetLineUnstretchedLength(line, self.paid)
            self.moordyn.SetLineUnstretchedLengthVel(line, change / h)
        self.paid, self.reeling = self.paid + change, bool(change)

    def _levels(self) -> list[list[float]]:
        """Return depth and velocity of each level that is deeper than the one above it."""
        found: list[list[float]] = []
        for n in range(1, len(self.levels) // 4 + 1):
            level = [getattr(self, f"{name}_{n}") for name in ("depth", "V_N", "V_E", "V_D")]
            if found and level[0] <= found[-1][0]:
                break
            found.append(level)
        return found

    def _velocities(self, places: list[float], h: float) -> list[float]:
        """Return the velocities of both ends in the frame of MoorDyn; three places give them to 2nd order."""
        self.history = [*self.history, places][-3:]
        factors = {1: (0.0,), 2: (-1.0, 1.0), 3: (0.5, -2.0, 1.5)}[len(self.history)]
        found = self._of_ends("NED", "vg_{}_{}")
        for n, end in enumerate(ENDS):
            if getattr(self, f"difference_{end}"):
                for k in range(3 * n, 3 * n + 3):
                    found[k] = sum(factor * past[k] for factor, past in zip(factors, self.history, strict=True)) / h
        return found

    def _of_water(self, names: Sequence[str], n: int) -> list[float]:
        """Return a vector of the water in waves at a node in the frame of MoorDyn."""
        return turned([getattr(self, f"{name}_p{n}") for name in names])

    def _of_ends(self, axes: str, name: str) -> list[float]:
        """Return a vector of both ends in the frame of MoorDyn."""
        return [x for end in ENDS for x in turned([getattr(self, name.format(d, end)) for d in axes])]


def turned(vector: Sequence[float]) -> list[float]:
    """Return a vector north, east, down in the frame of MoorDyn, or one in this frame north, east, down."""
    x, y, z = vector
    return [x, -y, -z]
