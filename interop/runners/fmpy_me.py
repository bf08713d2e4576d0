"""FMPy, Model Exchange: CVode, the inputs from an array with two rows where they jump."""

import numpy as np
from fmpy import simulate_fmu
from fmpy.util import read_csv, write_csv

from interop.runners.flight import FMU, OUTPUTS, parameters


def main() -> None:
    """Fly the manoeuvre."""
    result = simulate_fmu(
        FMU,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-9,
        stop_time=30.0,
        output_interval=0.1,
        start_values=parameters(),
        input=read_csv("jumps.csv"),
        output=OUTPUTS,
    )
    write_csv("result.csv", np.asarray(result))


if __name__ == "__main__":
    main()
