"""The exact limits of the checks of files."""

from pathlib import Path

import pytest

from rov_fmu.equation.catalogue import AXES, HEAVE
from rov_fmu.equation.layout import Layout, VehicleAxis
from rov_fmu.io.csv_table import DataFileError, read_columns
from rov_fmu.tank.columns import columns_of, columns_of_log, known_columns
from tests.vehicles import VIDEORAY

COLUMNS = {
    **{kind: columns_of(kind) for kind in ("thrust", "steady", "time_constant")},
    "log": known_columns(columns_of_log(VIDEORAY.layout, HEAVE)),
    "wrench": known_columns(columns_of_log(Layout.of_wrench(map(VehicleAxis, AXES.values())), None)),
}


@pytest.mark.parametrize(
    ("file", "title", "within", "beyond"),
    [
        ("thrust", "command [%]", "-100", "-100.01"),
        ("thrust", "command [%]", "100", "100.01"),
        ("thrust", "command [%]", "0.01", "0.0099"),
        ("thrust", "force [N]", "-1e6", "-1000001"),
        ("thrust", "force [N]", "1e6", "1000001"),
        *(("steady", f"velocity [{unit}]", "-1e3", "-1000.1") for unit in ("m/s", "rad/s")),
        ("steady", "velocity [m/s]", "1e3", "1000.1"),
        ("steady", "velocity [m/s]", "-1e-5", "-9.9e-6"),
        ("time_constant", "time constant [s]", "1e5", "100001"),
        ("time_constant", "time constant [s]", "1e-4", "9.9e-5"),
        *(("log", "time [s]", f"{sign}1e10", f"{sign}1.0001e10") for sign in ("", "-")),
        *(("log", "depth [m]", f"{sign}1e7", f"{sign}10000001") for sign in ("", "-")),
        *(("log", "velocity [m/s]", f"{sign}1e3", f"{sign}1000.1") for sign in ("", "-")),
        *(("log", "command [1]", f"{sign}1", f"{sign}1.001") for sign in ("", "-")),
        *(("log", "voltage [V]", end, beyond) for end, beyond in (("0", "-1"), ("1e4", "10001"))),
        *(("log", "pressure [Pa]", end, beyond) for end, beyond in (("0", "-1"), ("1e9", "1000000001"))),
        ("wrench", "X_ext [N]", "-1e6", "-1000001"),
        ("wrench", "torque z [N.m]", "1e6", "1000001"),
    ],
)
def test_bounds_of_every_column(file: str, title: str, within: str, beyond: str, tmp_path: Path) -> None:
    path, name = tmp_path / "a.csv", title.partition(" [")[0]
    columns = {key: column for key, column in COLUMNS[file].items() if name in (key, *column.also)}
    path.write_text(f"{title}\n{within}\n", encoding="utf-8")
    assert [*read_columns(path, columns).values]
    path.write_text(f"{title}\n{beyond}\n", encoding="utf-8")
    with pytest.raises(DataFileError, match="line 2, column"):
        read_columns(path, columns)
