"""The name and the version of this program, as what it makes tells them."""

from functools import cache
from hashlib import sha256
from pathlib import Path

from rov_fmu import __version__
from rov_fmu.io.paths import FMU_SRC

_CODE = Path(__file__).parent.parent


@cache
def version() -> str:
    """Return the version. One in development has a digest of the code, since many states of the code share its number.

    So two FMUs, vehicle files or studies that other code made can be told apart.
    """
    if ".dev" not in __version__:
        return __version__
    digest = sha256()
    for folder in (_CODE, FMU_SRC):
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            name = path.relative_to(folder)
            if not {"data", "__pycache__"} & {*name.parts}:  # data/ of an installed package has fmu_src, too
                digest.update(b"%s %d\n" % (name.as_posix().encode(), path.stat().st_size) + path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:10]}"


def program() -> str:
    """Return the name and the version."""
    return f"rov-fmu {version()}"
