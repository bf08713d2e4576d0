"""The exact limits of the checks of files."""

from pathlib import Path

import pytest

from rov_fmu.equation.catalogue import AXES, HEAVE
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import VehicleAxis
from rov_fmu.io.csv_table import DataFileError, read_columns
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.columns import Names, columns_of, columns_of_log, known_columns
from rov_fmu.tank.read_log import read_logs
from tests.vehicles import VIDEORAY

COLUMNS = {
    **{kind: columns_of(kind) for kind in ("thrust", "steady", "time_constant")},
    "log": known_columns(columns_of_log(VIDEORAY.layout, HEAVE)),
    "wrench": known_columns(columns_of_log(Layout.of_wrench(map(VehicleAxis, AXES.values())), None)),
}


LIMITS = """
thrust: command [%]: -100, -100.01; 100, 100.01; 0.01, 0.0099
thrust: force [N]: -1e6, -1000001; 1e6, 1000001
steady: velocity [m/s]: -1e3, -1000.1; 1e3, 1000.1; -1e-5, -9.9e-6
steady: velocity [rad/s]: -1e3, -1000.1
time_constant: time constant [s]: 1e5, 100001; 1e-4, 9.9e-5
log: time [s]: -1e10, -1.0001e10; 1e10, 1.0001e10
log: command [1]: -1, -1.001; 1, 1.001
wrench: X_ext [N]: -1e6, -1000001; 1e6, 1000001
wrench: torque z [N.m]: 1e6, 1000001
"""
"""The kind of file, the header, and numbers within and beyond each limit."""


@pytest.mark.parametrize("line", LIMITS.strip().splitlines())
def test_bounds_of_every_column(line: str, tmp_path: Path) -> None:
    file, title, limits = line.split(": ")
    path, name = tmp_path / "a.csv", title.partition(" [")[0]
    columns = {key: column for key, column in COLUMNS[file].items() if name in (key, *column.also)}
    for within, beyond in (limit.split(", ") for limit in limits.split("; ")):
        path.write_text(f"{title}\n{within}\n", encoding="utf-8")
        assert [*read_columns(path, columns).values]
        path.write_text(f"{title}\n{beyond}\n", encoding="utf-8")
        with pytest.raises(DataFileError, match="line 2, column"):
            read_columns(path, columns)


@pytest.mark.parametrize("name", QUANTITIES)
def test_bounds_of_every_quantity(name: str, tmp_path: Path) -> None:
    quantity, path = QUANTITIES[name], tmp_path / "a.csv"
    beside = "heading [rad]" if name == "depth" else "depth [m]"
    assert quantity.minimum == (0.0 if name in ("pressure", "voltage") else -quantity.maximum), "these have no sign"
    for limit, beyond in (
        (quantity.minimum, quantity.minimum * 1.001 - 1.0),
        (quantity.maximum, quantity.maximum * 1.001),
    ):
        rows = [f"time [s],u_t [%],{beside},{name} [{quantity.unit}]", *(f"{n},{n},{n},{{0}}" for n in range(9))]
        path.write_text("\n".join(rows).format(limit), encoding="utf-8")
        assert len(read_logs(path, VIDEORAY.layout, Names())) == 1
        path.write_text("\n".join(rows).format(beyond), encoding="utf-8")
        with pytest.raises(DataFileError, match=r"column .* as in 9 rows: must be within"):
            read_logs(path, VIDEORAY.layout, Names())
