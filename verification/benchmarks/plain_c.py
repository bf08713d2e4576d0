"""Measurements in plain C, built with the compiler of the FMU and called in this process (Linux on x86-64)."""

import ctypes
from ctypes import byref, c_double, c_long, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import sundials
from fmpy.sundials.libraries import sundials_core, sundials_cvode
from numpy.typing import NDArray

from rov_fmu.c.compile import PLATFORMS, compile_all, host_platform
from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references.c_programs import compile_c

from .taylor import Heyoka

PLATFORM = "linux64"
# The methods: the FMU, and the FMU with its commands set before every step; its step without FMI; the explicit methods;
# the methods of CVODE.
FMU, FMU_SET = FMUS = ("fmu", "fmu-set")
CORE, EULER, RK4 = "core", "euler", "rk4"
HEYOKA = "heyoka"
BDF, ADAMS = CVODE = ("bdf", "adams")
_SOURCES = Path(__file__).with_name("c")
# A library uses only some functions of the FMU's sources.
_FLAGS = (
    "-target",
    PLATFORMS[PLATFORM].target,
    "-shared",
    "-g0",
    "-fno-asynchronous-unwind-tables",
    "-Wshadow",
    "-Wno-unused-function",
)
# Packed into pairs, RK4 takes a fifteenth longer for the VideoRay, and a tenth less for the Heavy.
_FASTEST = ("-O3", "-fno-slp-vectorize")
_SUNDIALS = (sundials_core._name, sundials_cvode._name)
_REALS = np.ctypeslib.ndpointer(float, flags="C")

Reals = NDArray[np.float64]


def measurable() -> bool:
    """Return True when this machine can run the measurements."""
    return host_platform() == PLATFORM


class PlainC:
    """The FMU's shared library, and libraries with the other methods and the timing."""

    def __init__(self, vehicle: Vehicle, folder: Path) -> None:
        sources = native_content(vehicle).sources
        self._states = len(vehicle.layout.state)

        def load(name: str, *flags: str) -> Any:
            output = folder / f"{name}.so"
            return ctypes.CDLL(str(compile_c(_SOURCES / f"{name}.c", output, sources, *_FLAGS, *flags)))

        fmu = folder / f"{vehicle.identifier}{PLATFORMS[PLATFORM].suffix}"
        fmu.write_bytes(compile_all([PLATFORM], sources, vehicle.identifier)[PLATFORM])
        self._explicit, self._measure = load("explicit", *_FASTEST), load("measure", "-ldl", *_SUNDIALS)
        self._measure.hold.argtypes = (*[c_void_p] * 3, c_double, *[c_long] * 3, _REALS, _REALS)
        self._measure.hold.restype = c_double
        self._measure.begin(str(fmu).encode())
        self._solver = cache(self._new_solver)
        self._heyoka = cache(lambda: Heyoka(vehicle))

    def _new_solver(self, method: str, tolerance: float) -> tuple[Any, Any]:
        """Return a solver of CVODE with equal relative and absolute tolerances, and its vector.

        BDF: Newton's method with a dense matrix, as FMPy sets it up. Adams: fixed-point iteration.
        """
        context = sundials.SUNContext()
        flags = [sundials.SUNContext_Create(sundials.SUN_COMM_NULL, byref(context))]
        y = sundials.N_VNew_Serial(self._states, context)
        rates = sundials.CVRhsFn(("cvode_rates", self._measure))
        solver = sundials.CVodeCreate(2 if method == BDF else 1, context)
        flags += [sundials.CVodeInit(solver, rates, 0.0, y), sundials.CVodeSetMaxNumSteps(solver, 1_000_000)]
        flags += [sundials_cvode.CVodeSStolerances(c_void_p(solver), c_double(tolerance), c_double(tolerance))]
        if method == ADAMS:
            sundials_cvode.SUNNonlinSol_FixedPoint.restype = c_void_p
            iteration = c_void_p(sundials_cvode.SUNNonlinSol_FixedPoint(y, 0, context))
            flags += [sundials_cvode.CVodeSetNonlinearSolver(c_void_p(solver), iteration)]
        else:
            matrix = sundials.SUNDenseMatrix(self._states, self._states, context)
            flags += [sundials.CVodeSetLinearSolver(solver, sundials.SUNLinSol_Dense(y, matrix, context), matrix)]
        if any(flags):
            raise RuntimeError(f"CVODE cannot be set up: {flags}")
        return solver, ctypes.cast(y, c_void_p)

    def hold(
        self, method: str, setting: float, h: float, steps: int, commands: Reals, start: Reals
    ) -> tuple[float, Reals]:
        """Hold each command for `steps` steps of h. Return seconds per step, and the final state.

        `setting` is the number of sub-steps, or the tolerance of CVODE.
        """
        if method == HEYOKA:
            return self._heyoka().hold(h, steps, commands, start)
        function, solver, end = None, (None, None), start.copy()
        if method in CVODE:
            solver = self._solver(method, setting)
        elif method not in FMUS:
            library = self._measure if method == CORE else self._explicit
            function = ctypes.cast(getattr(library, method), c_void_p)
        substeps = 0 if method == FMU_SET else 1 if method in CVODE else round(setting)
        each = self._measure.hold(function, *solver, h, substeps, steps, len(commands), commands, end)
        return 1e-9 * each, end
