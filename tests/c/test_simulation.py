"""The engine computes the same bits as the FMU, for any number of vehicles and threads."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.c.simulation import Array, simulate
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import ROOT
from tests.fmi2 import Fmu
from tests.often import spread
from tests.vehicles import EVERYTHING, HEAVY, SIX, VIDEORAY, random_inputs, random_state


def in_fmu(folder: Path, rov: Vehicle, times: Array, inputs: dict[str, Array], start: dict[str, float]) -> Array:
    """Return the states and calculated variables of an FMU at each time, as an array of variables x times."""
    rows = []
    with Fmu(folder).instance() as instance:
        instance.start(start)
        for n, (time, h) in enumerate(zip(times, np.diff(times, append=0.0), strict=True)):
            instance.set({name: values[n] for name, values in inputs.items()})
            rows.append(instance.get([*rov.layout.state, *rov.layout.calculated]))
            if n + 1 < len(times):
                instance.step(time, h)
    return np.array(rows).T


@pytest.mark.parametrize(
    "name", spread(["videoray", "everything", "heavy", "six"], ["videoray"], ["everything", "six"])
)
def test_it_computes_the_bits_of_the_fmu(name: str, request: pytest.FixtureRequest) -> None:
    rov = {"videoray": VIDEORAY, "heavy": HEAVY, "everything": load_vehicle(EVERYTHING), "six": SIX}[name]
    folder = request.getfixturevalue(f"{name}_dir")
    rng = random.Random(7)
    lengths = [rng.choice([2.0**-10, 2.0**-6, 2.0**-3, 1.0, 16.0]) for _ in range(200)]
    times = np.cumsum([0.0, *lengths])  # all sums are exact
    drawn = [random_inputs(rng, rov) for _ in times]
    inputs = {name: np.array([each[name] for each in drawn]) for name in rov.layout.inputs}
    start = {name: x for name, x in random_state(rng, rov).items() if name not in QUATERNION}
    start |= {name: rng.uniform(-3.0, 3.0) for name in rov.layout.initial}
    found = simulate(rov, times, {**inputs, **start}, [*rov.layout.state, *rov.layout.calculated])
    assert found.failed == len(times)
    np.testing.assert_array_equal(found.values[:, 0], in_fmu(folder, rov, times, inputs, start))


@pytest.mark.parametrize("lanes", [False, True])
def test_an_output_is_the_same_where_it_is_recorded_alone(lanes: bool) -> None:
    """Outputs are calculated only for those who record them. Some have places behind the parameters."""
    values, outputs = {"u_1": 0.5, "u_2": -0.3, "V_N": 0.2, "psi": 1.0}, [*HEAVY.layout.calculated]
    whole = simulate(HEAVY, [0.0, 0.3], values, outputs, lanes=lanes).values[:, 0, 1]
    alone = [simulate(HEAVY, [0.0, 0.3], values, [name], lanes=lanes).values[0, 0, 1] for name in outputs]
    np.testing.assert_array_equal(alone, whole)
    assert whole[[outputs.index("vg_N"), outputs.index("electric_current")]].all()


_ENDLESS = """
import sys, time
import numpy as np
import rov_fmu
rov = rov_fmu.load("videoray")
rov.simulate([0, 1])
print("begins", flush=True)
try:
    rov.simulate_many(np.arange(1000.0), {"u_l": 0.5}, coefficients={"a_d_u": np.full(1_000_000, 10.0)}, record="u")
except KeyboardInterrupt:
    print("interrupted", time.time(), flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
def test_ctrl_c_ends_it() -> None:
    """The simulation would take minutes."""
    process = subprocess.Popen(
        [sys.executable, "-c", _ENDLESS],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
    )
    with process:
        assert process.stdout
        assert process.stdout.readline() == "begins\n"
        time.sleep(0.3)
        sent = time.time()
        process.send_signal(signal.SIGINT)
        word, ended = process.stdout.read().split()
    assert (process.returncode, word) == (0, "interrupted")
    assert float(ended) - sent < 5.0


_AS_A_THREAD_STARTS = """
import threading
start = threading.Thread.start
def interrupted(thread):
    start(thread)
    raise KeyboardInterrupt
threading.Thread.start = interrupted
"""


def test_ctrl_c_as_a_thread_starts_ends_it_too() -> None:
    """The executor does not wait for this thread. It may work on no memory that is free again."""
    program = _AS_A_THREAD_STARTS + _ENDLESS
    done = subprocess.run(
        [sys.executable, "-c", program], check=False, cwd=ROOT, stdout=subprocess.PIPE, text=True, timeout=60
    )
    assert (done.returncode, done.stdout.split()[:2]) == (0, ["begins", "interrupted"])
