"""An FMU that may come from anyone: what it has, and runs of it in a process with limits."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property, partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import Self

from rov_fmu.fmu.terminals import FOLDER
from rov_fmu.fmus.description import TIME_LIMIT, budget, described, read_description
from rov_fmu.fmus.instance import Array, LoadError, RunError
from rov_fmu.fmus.simulation import Exchange, Simulation
from rov_fmu.fmus.unpacking import opened_archive, unpack_fmu
from rov_fmu.fmus.variable import Described
from rov_fmu.io.child_process import ChildError, ChildProcess
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError
from rov_fmu.io.reading import check_size, read_bytes, root_of_xml

_TERMINALS = f"{FOLDER}/terminalsAndIcons.xml"
_MOST_BYTES = 4_000_000
"""The largest file of terminals that is read."""


@dataclass(frozen=True)
class Fmu(Described):
    """An FMU of FMI 2.0 or 3.0 for Co-Simulation, or one of ours for Model Exchange alone."""

    path: Path
    """Where it is from, for messages."""
    content: bytes
    description: Any
    """FMPy's."""

    @classmethod
    def open(cls, path: Path, content: bytes | None = None, *, is_ours: bool = False, **more: Any) -> Self:
        """Read an FMU: the file at a path, or its content, of which messages say the path. Raises FileError.

        `is_ours` is True for one that this process has just made, so that it needs no child process to read it, and may
        be for Model Exchange alone. `more` is what a subclass has beside it.
        """
        content = read_bytes(path) if content is None else content
        with temporary_folder("fmu-") as folder:
            unpack_fmu(BytesIO(content), path, Path(folder))
            description = described(folder) if is_ours else read_description(path, Path(folder))
        if description.fmiVersion[:1] not in ("2", "3"):
            raise FileError(f"{path}: is of FMI {description.fmiVersion}, and not of 2.0 or 3.0")
        if description.coSimulation is None and not is_ours:
            raise FileError(f"{path}: is not for Co-Simulation")
        return cls(path, content, description, **more)

    @cached_property
    def terminals(self) -> Mapping[str, Mapping[str, str]]:
        """The variables by the names of the members, for each terminal. Raises FileError.

        A terminal with terminals or streams in it is left out, because a connection of its variables would be a half.
        """
        where = f"{self.path}: {_TERMINALS}"
        with opened_archive(BytesIO(self.content), self.path) as zipped:
            if _TERMINALS not in zipped.namelist():
                return {}
            check_size(where, zipped.getinfo(_TERMINALS).file_size, _MOST_BYTES)
            content = zipped.read(_TERMINALS)
        try:
            root = root_of_xml(content)
        except ValueError as error:
            raise FileError(f"{where}: {error}") from error
        return {
            terminal.get("name", ""): {
                member.get("memberName", ""): member.get("variableName", "")
                for member in terminal.findall("TerminalMemberVariable")
            }
            for terminal in root.findall("Terminals/Terminal")
            if terminal.find("Terminal") is None and terminal.find("TerminalStreamMemberVariable") is None
        }

    def unpack(self, folder: Path) -> None:
        """Unpack the FMU into a folder. Raises FileError."""
        unpack_fmu(BytesIO(self.content), self.path, folder)

    def run(
        self,
        times: Array,
        inputs: Mapping[str, Array | float],
        record: Sequence[str],
        start: Mapping[str, float] = {},
        time_limit: float = TIME_LIMIT,
    ) -> dict[str, Array]:
        """Run the FMU once in a process of its own, and return what is recorded, by variable.

        - `times`: the communication points, s, at equal distances.
        - `inputs`: the value of each input, or its values at each time but the last one, which are held from there on.
          In an FMU for Model Exchange alone, they are constant.
        - `record`, `start`: the variables that are read at each time, and the start values.

        Raises FileError, and RunError with the reason, also if the FMU ends its process or exceeds a limit.
        """
        steps = len(times) - 1
        held = {name: np.broadcast_to(np.asarray(values, np.float64), steps) for name, values in inputs.items()}
        with temporary_folder("fmu-") as folder:
            self.unpack(Path(folder))
            step = (times[-1] - times[0]) / steps
            run = partial(ChildProcess, Simulation, folder, times, step, start, held, record)
            if self.description.coSimulation is None:
                constant = {name: float(values) for name, values in inputs.items()}
                run = partial(ChildProcess, Exchange, folder, times, {**start, **constant}, record)
            try:
                with closing(run(limits=budget(time_limit))) as child:
                    found: dict[str, Array] = child.call("run", ())
            except ChildError as error:
                raise RunError(f"it {error}") from error
            except LoadError as error:
                raise RunError(str(error)) from error
        return found
