"""Vehicles of no one's, which fuzzing and the importers share."""

from pathlib import Path

_HERE = Path(__file__).parent
THRUST = _HERE / "thrust.toml"
"""A vehicle with everything that thrust can depend on."""
EVERY_OPTION = _HERE / "every_option.toml"
"""A vehicle with every option: also six axes, restoring moments, mixed commands and pulse widths."""
IDENTIFIED = _HERE / "identified.toml"
"""A vehicle that `rov-fmu identify` made from the dive log of the tutorial: with tested ranges and verdicts."""
