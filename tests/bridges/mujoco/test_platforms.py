"""The libraries of an exported folder run on every system as on Linux, with a stand-in for MuJoCo (host.c)."""

import os
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.bridges.mujoco.source import water_sources
from rov_fmu.c.compile import PLATFORMS, compile_engine
from rov_fmu.tank.arrays import Array
from tests.bridges.test_mujoco import loaded
from tests.fmu.test_binaries import MACHINES
from tests.often import spread
from verification.references.c_programs import compile_c, run_program


def given(name: str) -> Iterator[tuple[float, ...]]:
    """Yield what the program reads: the mass of the rigid body, the numbers of the vehicle, and commands for 0.4 s."""
    vehicle, package = loaded(name)
    rov, random = package.load(), np.random.default_rng(7)
    yield (*rov._rigid.ravel(), *rov.coefficients.values(), *rov.inputs.values())
    for _ in range(20):
        commands = tuple(map(vehicle.layout.command_of, random.uniform(-0.8, 0.8, len(vehicle.layout.commands))))
        yield from [commands] * 10


def run(name: str, platform: str, folder: Path) -> Array:
    machine = MACHINES[platform]
    if missing := machine.missing():
        pytest.skip(f"{platform}: there is no {', '.join(missing)}")
    program, library = folder / f"host{machine.suffix}", folder / f"water{PLATFORMS[platform].suffix}"
    compile_c(Path(__file__).with_name("host.c"), program, folder, "-target", machine.target)
    library.write_bytes(compile_engine(water_sources(loaded(name)[0].layout), platform))
    text = "\n".join(" ".join(struct.pack(">d", x).hex() for x in row) for row in given(name))
    environment = os.environ | {"WINEPREFIX": str(folder / "wine"), "WINEDEBUG": "-all"}
    done = run_program(*machine.command, program, f"./{library.name}", input=text, cwd=folder, env=environment)
    assert done.code == 0, done.errors
    return np.array([[struct.unpack(">d", bytes.fromhex(x))[0] for x in line] for line in done.lines])


@pytest.mark.skipif(sys.platform != "linux", reason="the programs are run on Linux")
@pytest.mark.parametrize("platform", spread(["aarch64-linux", "win64"], (), ["aarch64-linux"]))
@pytest.mark.parametrize("name", ["every_option", "bluerov2"])
def test_every_platform_steps_as_linux64_does(name: str, platform: str, tmp_path: Path) -> None:
    expected = run(name, "linux64", tmp_path)
    assert expected.shape == (200, 13)
    assert np.isfinite(expected).all()
    assert np.ptp(expected, axis=0).max() > 0.1, "it moves"
    assert np.abs(run(name, platform, tmp_path) - expected).max() <= 1e-12
