"""The build backend (PEP 517): hatchling, whose wheels also contain what the vehicles that ship need a compiler for.

A wheel has their FMUs, the engine of each kind of vehicle for each platform, and the module of its page, so
that `rov-fmu fly`, `simulate` and `build` of these vehicles compile nothing. An editable installation has none of it.
HATCH_BUILD_NO_HOOKS=true makes a wheel without it, which compiles when it has to.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling import build as hatch
from hatchling.build import build_editable, build_sdist, build_wheel, get_requires_for_build_editable
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.core import ProjectMetadata

__all__ = ["build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable"]

get_requires_for_build_sdist = hatch.get_requires_for_build_sdist


def get_requires_for_build_wheel(config_settings: dict[str, Any] | None = None) -> list[str]:
    """Return what a wheel is built with: what the package needs, in the versions that shape the bytes of FMUs."""
    needed = hatch.get_requires_for_build_wheel(config_settings)
    if os.environ.get("HATCH_BUILD_NO_HOOKS") == "true":
        return needed
    lines = Path("constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    return [*needed, *ProjectMetadata(str(Path.cwd()), None).core.dependencies, *pins]


class Prebuilt(BuildHookInterface[Any]):
    """Put the compiled files into a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile them, unless the installation is editable."""
        if version == "editable":
            return
        self.folder = TemporaryDirectory(prefix="rov-fmu-prebuilt-")
        subprocess.run([sys.executable, __file__, self.folder.name], cwd=self.root, check=True)
        build_data["force_include"][self.folder.name] = "rov_fmu/data/prebuilt"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove the folder with the compiled files."""
        if version != "editable":
            self.folder.cleanup()


def prebuild(folder: Path) -> None:
    """Compile everything into a folder."""
    from rov_fmu.autopilot.law import FILES, law_sources
    from rov_fmu.build import build_fmu
    from rov_fmu.c.compile import HOSTS, compile_engine, compile_module
    from rov_fmu.c.library import engine_sources
    from rov_fmu.c.prebuilt import MODULE, prebuilt_path
    from rov_fmu.fmu.content import module_sources
    from rov_fmu.vehicle.shipped import SHIPPED
    from rov_fmu.vehicle.vehicle import load_vehicle

    law = law_sources(*FILES)
    for kind in HOSTS:
        prebuilt_path(folder, kind, law).write_bytes(compile_engine(law, kind))
    for name, file in SHIPPED.items():
        vehicle = load_vehicle(file)
        build_fmu(vehicle, folder / f"{name}.fmu")
        module, engine = module_sources(vehicle.layout), engine_sources(vehicle.layout)
        # Vehicles with the same equation share these files.
        for kind in (MODULE, *HOSTS):
            sources = module if kind == MODULE else engine
            path = prebuilt_path(folder, kind, sources)
            if not path.exists():
                path.write_bytes(compile_module(sources) if kind == MODULE else compile_engine(sources, kind))


if __name__ == "__main__":
    prebuild(Path(sys.argv[1]))
