"""Where the files that are no Python stand: in an installed package inside it, in a checkout at its top."""

from pathlib import Path

_PACKAGE = Path(__file__).parent.parent
_TOP = _PACKAGE / "data" if (_PACKAGE / "data").is_dir() else _PACKAGE.parent

FMU_SRC = _TOP / "fmu_src"
"""What goes into an FMU as it stands."""
LICENSE = _TOP / "LICENSE"
MODELS = _TOP / "models"
"""The vehicles that ship, a folder each."""
