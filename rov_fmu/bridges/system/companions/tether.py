"""A tether between two points, as a PythonFMU slave: MoorDyn's chain of masses and springs in flowing water.

Each end is a port: place and velocity over ground go in, and the force that the tether exerts there comes out. An end
that is not connected stays where it starts. The tether hangs at rest when the first step begins, and pulls from the
second step on. Places are north, east and down from the surface; in MoorDyn x is north, y west, z up.
"""

from itertools import pairwise
from math import ceil, hypot, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

from pythonfmu import DefaultExperiment, Fmi2Slave, Real
from pythonfmu.enums import Fmi2Causality, Fmi2Status, Fmi2Variability

SEGMENTS, SHOWN, LEVELS = 20, 11, range(1, 7)  # of the line, the points of its shape, the levels of the water
SUBSTEP = 0.2  # of the time in which a wave of tension passes a segment: twice as much can be unstable
ENDS = {"top": "upper", "bottom": "lower"}
AXES = (("N", "x", "north"), ("E", "y", "east"), ("D", "z", "down"))

# name: causality, start, unit, description
VARIABLES: dict[str, tuple[str, float, str, str]] = {
    "length": ("parameter", 60.0, "m", "Length without tension"),
    "diameter": ("parameter", 0.0076, "m", "Diameter"),
    "mass": ("parameter", 0.0465, "kg/m", "Mass over length; 0.0465 floats with the default diameter"),
    "EA": ("parameter", 2e4, "N", "Stiffness: tension over strain"),
    "C_d": ("parameter", 1.2, "1", "Drag coefficient across the tether"),
    "C_d_along": ("parameter", 0.02, "1", "Drag coefficient along the tether"),
    "rho": ("parameter", 1025.0, "kg/m3", "Density of the water"),
    "seabed": ("parameter", 100.0, "m", "Depth of the seabed"),
}
for end, words in ENDS.items():
    VARIABLES |= {f"F_{d}_{end}": ("output", 0.0, "N", f"Force at the {words} end, positive {to}") for d, _, to in AXES}
    VARIABLES |= {f"{x}_{end}": ("input", 0.0, "m", f"Position of the {words} end, {to}") for _, x, to in AXES}
    VARIABLES |= {f"vg_{d}_{end}": ("input", 0.0, "m/s", f"Velocity of the {words} end, {to}") for d, _, to in AXES}
    VARIABLES[f"tension_{end}"] = ("output", 0.0, "N", f"Size of the force at the {words} end")
PROFILE = {
    f"{name}_{n}": ("input", 0.0, unit, f"{what} at level {n} of the water, level 1 at the top")
    for n in LEVELS
    for name, unit, what in (("depth", "m", "Depth"), ("V_N", "m/s", "Current north"), ("V_E", "m/s", "Current east"))
}
VARIABLES |= PROFILE | {
    f"{x}_{n}": ("output", 0.0, "m", f"Shape: {to}, {n}/{SHOWN - 1} along from the upper end")
    for n in range(SHOWN)
    for _, x, to in AXES
}

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
{seabed} WtrDpth
{rho} rho
1 WaveKin
--- END ---
"""


class Tether(Fmi2Slave):  # type: ignore[misc]
    """The slave."""

    author = "rov-fmu"
    description = "A tether between two points in flowing water (MoorDyn)"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=0.02)
    variables = VARIABLES
    needs = "moordyn"
    points = tuple(ENDS)
    terminals = (("profile", tuple(PROFILE)),)

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.system: object = None
        for name, (causality, start, _, text) in VARIABLES.items():
            setattr(self, name, start)
            changes = Fmi2Variability.fixed if causality == "parameter" else Fmi2Variability.continuous
            kind = {"causality": Fmi2Causality[causality], "variability": changes}
            self.register_variable(Real(name, description=text, **kind))

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Hold the velocities of the ends for a step. A step that MoorDyn cannot do is refused."""
        # Steps of an importer that counts in ns differ in their last bits: MoorDyn would do one substep more or less.
        t, h = round(current_time, 9), round(step_size, 9)
        places = self._of_ends("xyz", "{}_{}")
        try:
            if self.system is None:
                self._begin(places, h)
            own, moordyn = self.__dict__, self.moordyn
            nodes = moordyn.ExternalWaveKinGetCoordinates(self.system)
            levels = [[getattr(self, f"{name}_{n}") for name in ("depth", "V_N", "V_E")] for n in LEVELS]
            water = [current(levels, -z) for _, _, z in nodes]
            moordyn.ExternalWaveKinSet(self.system, water, [[0.0, 0.0, 0.0]] * len(nodes), t)
            forces = moordyn.Step(self.system, places, self._of_ends("NED", "vg_{}_{}"), t, h)
        except (ImportError, RuntimeError) as error:
            self.log(f"MoorDyn: {error}", Fmi2Status.error)
            return False
        for n, end in enumerate(ENDS):
            x, y, z = forces[3 * n : 3 * n + 3]
            own |= {f"F_N_{end}": x, f"F_E_{end}": -y, f"F_D_{end}": -z, f"tension_{end}": hypot(x, y, z)}
        line = moordyn.GetLine(self.system, 1)
        for n in range(SHOWN):
            x, y, z = moordyn.GetLineNodePos(line, n * SEGMENTS // (SHOWN - 1))
            own |= {f"x_{n}": x, f"y_{n}": -y, f"z_{n}": -z}
        return True

    def terminate(self) -> None:
        """End MoorDyn."""
        if self.system is not None:
            self.moordyn.Close(self.system)

    def _begin(self, ends: list[float], h: float) -> None:
        """Find the tether at rest between its ends."""
        import moordyn

        self.moordyn = moordyn
        own = self.__dict__
        substep = h / ceil(h / (SUBSTEP * own["length"] / SEGMENTS * sqrt(own["mass"] / own["EA"])))
        with TemporaryDirectory() as folder:
            file = Path(folder, "tether.txt")
            file.write_text(FILE.format(**own, ends=ends, segments=SEGMENTS, substep=substep), encoding="utf-8")
            self.system = moordyn.Create(str(file))
            moordyn.SetVerbosity(self.system, moordyn.LEVEL_NONE)
            moordyn.Init(self.system, ends, [0.0] * 6)
        moordyn.ExternalWaveKinInit(self.system)

    def _of_ends(self, axes: str, name: str) -> list[float]:
        """Return a vector of both ends in the frame of MoorDyn."""
        signs = (1.0, -1.0, -1.0)
        return [sign * getattr(self, name.format(d, end)) for end in ENDS for d, sign in zip(axes, signs, strict=True)]


def current(levels: list[list[float]], depth: float) -> list[float]:
    """Return the velocity of the water at a depth in the frame of MoorDyn, on straight lines between the levels."""
    V_N, V_E = levels[-1][1:] if depth > levels[0][0] else levels[0][1:]
    for (a, *above), (b, *below) in pairwise(levels):
        if a < depth <= b:
            V_N, V_E = (p + (depth - a) / (b - a) * (q - p) for p, q in zip(above, below, strict=True))
    return [V_N, -V_E, 0.0]
