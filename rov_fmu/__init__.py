"""Make FMUs of identified underwater vehicles (ROVs): from tank tests to a vehicle file, and from that to an FMU.

import rov_fmu

vehicle = rov_fmu.load("videoray")
run = vehicle.simulate([0.0, 5.0, 10.0], {"u_l": 0.3, "u_r": 0.3})
print(run["u"])
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rov_fmu.interface.model import Vehicle, VehicleModel

__all__ = ["load"]
__version__ = "0.2.0"


def load(vehicle: "str | Path | Vehicle") -> "VehicleModel":
    """Load a vehicle that ships, by its name, or a vehicle file, by its path.

    - `vehicle`: a name, a path, or a vehicle from elsewhere, such as that of an identification, which is returned
      with the functions of the result.

        rov_fmu.load("bluerov2").response("surge", 0.3)  # V_ss, m/s, and Tau, s, at 30 %

    Raises FileError, a ValueError, with one line for each mistake.
    """
    from rov_fmu.interface.model import load as load_model  # imported here, so that `import rov_fmu` is quick

    return load_model(vehicle)
