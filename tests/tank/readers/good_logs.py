"""A good log of each format."""

from pathlib import Path

from tests.tank.readers import test_bags, test_mavlink, test_ulog

SUFFIXES = (".bin", ".tlog", ".ulg", ".bag", ".db3", ".mcap")


def good_log(suffix: str, folder: Path) -> Path:
    """Write a good log of a format."""
    if suffix == ".tlog":
        return test_mavlink.tlog(folder / "a.tlog", test_mavlink.dive())
    if suffix == ".bin":
        return test_mavlink.dataflash(folder / "a.bin", test_mavlink.turn())
    if suffix == ".ulg":
        return test_ulog.dive().write(folder / "a.ulg")
    ros = test_bags.Ros(1 if suffix == ".bag" else 2)
    return ros.write(folder, test_bags.dive(ros), suffix)
