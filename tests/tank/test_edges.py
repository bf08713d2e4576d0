"""The exact limits of the checks of files."""

from pathlib import Path

import pytest

from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.csv_table import DataFileError
from tests.commands import TESTS

_THRUST, _HEAVE = ("thrust_rear", "command [%],force [N]"), ("steady_heave", "command [%],velocity [m/s]")
_YAW, _TAU = ("steady_yaw", "command [%],velocity [rad/s]"), ("time_constant_yaw", "command [%],time constant [s]")
_DEPTH, _SPEED = ("log_heave", "time [s],command [%],depth [m]"), ("log_surge", "time [s],command [%],velocity [m/s]")

_VOLTAGE, _PRESSURE = ((_DEPTH[0], f"{_DEPTH[1]},{column}") for column in ("voltage [V]", "pressure [Pa]"))


@pytest.mark.parametrize(
    ("table", "within", "beyond"),
    [
        (_THRUST, "-100,-1", "-100.01,-1"),
        (_THRUST, "50,1e6", "50,1000001"),
        (_THRUST, "0.01,1", "0.0099,1"),
        *((table, "-50,-1e3", "-50,-1000.1") for table in (_HEAVE, _YAW)),
        *((table, "50,1e-5", "50,9.9e-6") for table in (_HEAVE, _YAW)),
        (_TAU, "50,1e5", "50,100001"),
        (_TAU, "50,1e-4", "50,9.9e-5"),
        (_DEPTH, "-1e10,0,0", "-1.0001e10,0,0"),
        *((_DEPTH, f"0,0,{sign}1e7", f"0,0,{sign}10000001") for sign in ("", "-")),
        *((_VOLTAGE, f"0,0,0,{end}", f"0,0,0,{beyond}") for end, beyond in ((0, -1), ("1e4", 10001))),
        *((_PRESSURE, f"0,0,0,{end}", f"0,0,0,{beyond}") for end, beyond in ((0, -1), ("1e9", 1000000001))),
        (_SPEED, "0,0,1e3", "0,0,1000.1"),
        (_SPEED, "0,0.001,1e-9", "0,100.1,1e-9"),
    ],
)
def test_bounds_of_every_column(table: tuple[str, str], within: str, beyond: str, tmp_path: Path) -> None:
    head = (TESTS / "rov.toml").read_text(encoding="utf-8").split("[known]")[0]
    (tmp_path / "rov.toml").write_text(f'base = "videoray"\n{head}', encoding="utf-8")
    name, header = table
    rest = (
        [f"{n},50,{1e-4 * n:g}" for n in range(1, 21)]
        if name.startswith("log")
        else ["60,1"]
        if name == "thrust_rear"
        else []
    )
    path = tmp_path / f"{name}.csv"
    path.write_text("\n".join((header, within, *rest)), encoding="utf-8")
    assert set(load_tests(tmp_path).inputs) == {"rov.toml", "videoray", path.name}
    path.write_text("\n".join((header, beyond, *rest)), encoding="utf-8")
    with pytest.raises(DataFileError, match="line 2, column"):
        load_tests(tmp_path)
