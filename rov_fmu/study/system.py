"""The system (SSP) that a study runs many times. Its variables are those of all components, with the names
component.variable."""

import zipfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.bridges.system.connections import SystemStructure
from rov_fmu.bridges.system.half_step import half_step
from rov_fmu.bridges.system.master import Master, Name, busy, folders_of
from rov_fmu.bridges.system.ssp import read_ssp
from rov_fmu.fmus.description import budget
from rov_fmu.fmus.instance import RunError
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.io.child_process import ChildError, ChildProcess
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.reading import read_bytes
from rov_fmu.study.model import Model
from rov_fmu.study.study import Study


@dataclass(frozen=True, kw_only=True)
class SystemModel(Model):
    """A system, whose content is that of the SSP."""

    structure: SystemStructure
    """What it has beside its FMUs: their paths in the SSP, start values and connections."""

    def unpack(self, folder: Path) -> None:
        """Unpack the FMU of each component into a folder of its own. Raises FileError."""
        with zipfile.ZipFile(BytesIO(self.content)) as archive:  # read_ssp has checked it
            for name, own in folders_of(folder, self.structure.sources).items():
                unpack_fmu(BytesIO(archive.read(self.structure.sources[name])), Path(f"{self.name}: {name}"), own)

    def running(self, folder: str) -> str:
        """Return the component that a process ran which did not return."""
        return busy(folder, self.structure.sources)


def split(name: str) -> Name:
    """Return the component and the variable of a name."""
    component, _, own = name.partition(".")
    return component, own


def read_system(path: Path) -> SystemModel:
    """Read a system. Its variables have their start values there; one that is connected cannot be set.

    Raises FileError.
    """
    system = read_ssp(path)
    connected = {one.end for one in system.connections}
    variables = {}
    for component, part in system.parts.items():
        for own in (one for one in part.variables.values() if one.kind != "String"):
            is_connected, name = (component, own.name) in connected, f"{component}.{own.name}"
            variables[name] = replace(
                own,
                name=name,
                start=float(system.values[component].get(own.name, own.start)),
                can_be_set=own.can_be_set and not is_connected,
                causality="connected" if is_connected else own.causality,
            )
    structure = replace(system, parts={})
    return SystemModel(name=path.name, content=read_bytes(path), variables=variables, structure=structure)


class SystemSimulator:
    """An unpacked system, in a process of its own, with new instances for each run."""

    def __init__(self, folder: str, study: Study, model: SystemModel) -> None:
        self._study, self._model, system = study, model, model.structure
        self._master = Master(folder, [*system.sources], system.connections, [split(name) for name in study.recorded])

    def run(self, values: Sequence[float], parts: int = 1) -> dict[str, npt.NDArray[Any]]:
        """Run once and return every recorded variable at every communication point. Raises RunError.

        `values` are those of the varied variables. Each step of the study is made of some `parts`, between which the
        FMUs exchange values, too.
        """
        plan = self._study.plan
        inputs = {split(name): np.repeat(signal, parts) for name, signal in self._study.inputs.items()}
        start = {component: dict(own) for component, own in self._model.structure.values.items()}
        for name, value in {**plan.set, **dict(zip(self._study.varied, values, strict=True))}.items():
            component, own = split(name)
            start[component][own] = value
        rows = [self._master.begin(start, plan.step / parts, plan.stop_time, plan.start_time, inputs)]
        rows += self._master.step(plan.steps * parts)[parts - 1 :: parts]
        self._master.end()
        columns, has = zip(*rows, strict=True), self._model.variables
        return {name: np.array(own, has[name].dtype) for name, own in zip(self._study.recorded, columns, strict=True)}


def half_step_words(study: Study, model: SystemModel) -> str:
    """Return a line about what half the step changes in the first run; none if nothing is connected."""
    starts = dict.fromkeys(".".join(one.start) for one in model.structure.connections)
    if not (names := [name for name in starts if name in model.variables]):
        return ""
    alike, limits = replace(study, recorded=names, rows=study.rows[:1]), budget(2.0 * study.plan.time_limit)
    with temporary_folder("system-") as folder:
        model.unpack(Path(folder))
        try:
            with closing(ChildProcess(SystemSimulator, folder, alike, model, limits=limits)) as child:
                runs = [child.call("run", study.rows[0].tolist(), parts) for parts in (1, 2)]
        except (ChildError, RunError) as error:
            who = f"{model.running(folder)} " if isinstance(error, ChildError) else ""
            return f"half the step was tried in one run, which cannot be done: {who}{error}"
    rows, halved = (np.array([*run.values()], np.float64).T for run in runs)
    half = half_step(rows, halved, [model.variables[name].unit for name in names])
    return f"one run is {half.words([*map(split, names)])}"
