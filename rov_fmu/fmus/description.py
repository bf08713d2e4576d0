"""Read the model description of an FMU that may come from anyone, by FMPy, in a process with limits."""

import re
from collections import Counter
from contextlib import closing
from math import inf
from pathlib import Path
from sys import float_info
from typing import Any

from rov_fmu.io.child_process import ChildError, ChildProcess, Functions, Limits
from rov_fmu.io.messages import FileError, brief, reason_of, shown
from rov_fmu.io.reading import check_size, root_of_xml

TIME_LIMIT = 60.0
"""The seconds that an FMU may take to be loaded and to run one experiment, if nothing else is given."""
_MEMORY, _DISK = 4_000_000_000, 1_000_000_000
"""The address space of the process of an FMU and the size of each file that it writes, in bytes (Linux)."""
_DESCRIPTION = "modelDescription.xml"
_MOST_VARIABLES = 100_000
"""FMPy takes about 2 s and 0.4 GB for this number, and a minute for a million."""
_MOST_BYTES = 40_000_000
"""The largest size of a file of XML that FMPy reads."""
_LARGEST = {
    **dict.fromkeys(
        ("nominal", "factor", "offset", "gain", "startTime", "stopTime", "tolerance", "stepSize"), float_info.max
    ),
    **dict.fromkeys(("min", "max"), inf),  # and no NaN
    **dict.fromkeys(("numberOfEventIndicators", "numberOfContinuousStates"), _MOST_VARIABLES),
    **dict.fromkeys(("kg", "m", "s", "A", "K", "mol", "cd", "rad"), 1000),
}
"""The largest size of a number in an attribute, where the schema of FMI lets it have any."""
_HARMLESS = re.compile(
    r"^\S+ \([^)]*\): Element '\w+', attribute 'generationDateAndTime': |"
    r"(has no start value|provides a start value|is not (defined|allowed)|!= .continuous.|variable must be defined)\.$"
)
"""Mistakes that many exporters make, and that nothing depends on."""


def budget(time: float) -> Limits:
    """Return the limits of the process of an FMU that may take so many seconds."""
    return Limits(time=time, memory=_MEMORY, disk=_DISK)


def read_description(fmu: Path, folder: Path) -> Any:
    """Return FMPy's description of an unpacked FMU. Raises FileError, which names the FMU by the path `fmu`.

    What the schema of FMI forbids is refused, because other code relies on the types of the attributes.
    """
    try:
        with closing(ChildProcess(Functions, limits=budget(TIME_LIMIT))) as child:
            return child.call("call", described, str(folder))
    except Exception as error:  # what FMPy raises, of which pickle may make another kind
        reason = f"FMPy {error}" if isinstance(error, ChildError) else brief(reason_of(error), 240)
        raise FileError(f"{fmu}: {_DESCRIPTION}: {reason}") from error


def described(folder: str) -> Any:
    """Return FMPy's description of an unpacked FMU, in the child process. Raises ValueError, and what FMPy raises."""
    root, description = _root(folder), _validated(folder)
    for key, most in _LARGEST.items():
        for text in root.xpath(f"//@{key}[not(ancestor::Tool or ancestor::Annotation)]"):
            if not abs(float(text)) <= most:
                where = f"line {text.getparent().sourceline}: {key} = {shown(str(text))}"
                bounds = "a finite number" if most > _MOST_VARIABLES else f"a number from {-most} to {most}"
                raise ValueError(f"{where}: must be {bounds}")
    for name, times in Counter(variable.name for variable in description.modelVariables).items():
        if times > 1:
            raise ValueError(f"name = {shown(name)}: {times} variables have this name")
    for interface in (description.coSimulation, description.modelExchange, description.scheduledExecution):
        if interface and not re.fullmatch(r"[^/\\:]+", name := interface.modelIdentifier or ""):
            raise ValueError(f"modelIdentifier = {shown(name)}: must be a name without a path")
    return description


def _root(folder: str) -> Any:
    """Return the root element of the model description, which FMPy can read in a short time. Raises ValueError."""
    for name in (_DESCRIPTION, "sources/buildDescription.xml"):
        path = Path(folder, name)
        if path.is_file():
            check_size(name, path.stat().st_size, _MOST_BYTES, ValueError)
    path = Path(folder, _DESCRIPTION)
    if not path.is_file():
        raise ValueError("there is no such file in the FMU")
    root = root_of_xml(path.read_bytes())
    if not root.get("fmiVersion"):
        raise ValueError("must have an fmiVersion at its root")
    if root.getroottree().docinfo.internalDTD is not None:  # a few lines of entities can stand for gigabytes
        raise ValueError("has a document type definition (DTD); no model description needs one")
    if root.xpath(f"count(ModelVariables/*) > {_MOST_VARIABLES}"):
        raise ValueError(f"has more than {_MOST_VARIABLES} variables, the most that are read")
    return root


def _validated(folder: str, *, validate: bool = True) -> Any:
    """Return FMPy's description of an unpacked FMU, which is valid but for harmless mistakes."""
    import fmpy
    from fmpy.model_description import ValidationError

    try:
        return fmpy.read_model_description(folder, validate=validate)
    except ValidationError as error:
        serious = [problem for problem in error.problems if not _HARMLESS.search(problem)]
        if validate and not serious:
            return _validated(folder, validate=False)
        raise ValueError(re.sub(r"^\w+ \((line \d+).*?\)", r"\1", (serious or error.problems)[0])) from error
    except LookupError as error:
        raise ValueError(f"names a variable or a unit that does not exist: {error}") from error
