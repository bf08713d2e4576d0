"""FMPy, Co-Simulation: the FMU compiled from its sources (`fmpy compile`), then simulated in one call."""

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

from fmpy import simulate_fmu
from fmpy.util import read_csv, write_csv

from interop.runners.flight import FMU, OUTPUTS, parameters

COMPILED = "compiled.fmu"


def main() -> None:
    """Drop the binaries, compile, and fly the manoeuvre."""
    with ZipFile(FMU) as whole, ZipFile(COMPILED, "w") as sources:
        for name in whole.namelist():
            if not name.startswith("binaries/"):
                sources.writestr(name, whole.read(name))
    subprocess.run([Path(sys.executable).with_name("fmpy"), "compile", COMPILED], check=True)
    result = simulate_fmu(
        COMPILED,
        stop_time=30.0,
        output_interval=0.1,
        start_values=parameters(),
        input=read_csv("jumps.csv"),
        output=OUTPUTS,
    )
    write_csv("result.csv", result)


if __name__ == "__main__":
    main()
