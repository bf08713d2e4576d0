"""FMUs for tests of systems: vehicles that are described but not compiled, and FMUs of a few lines of XML."""

from collections.abc import Mapping, Sequence
from functools import cache

from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.content import native_content
from rov_fmu.fmu.variables import FmuModel
from rov_fmu.vehicle.vehicle import Vehicle


def described(vehicle: Vehicle) -> bytes:
    """Return the FMU of a vehicle without binaries and pages."""
    return archive(native_content(vehicle, {}, 2, "cs", ["linux64"]).files)


def described_model(model: FmuModel, _platforms: Sequence[str]) -> bytes:
    """Stand for `model_fmu`, which compiles."""
    return archive(native_content(model, interface="cs").files)


@cache
def foreign(
    unit: str = "m",
    kind: str = "Real",
    follows: bool = True,
    terminals: str = "",
    output: str = "y",
    **attributes: str,
) -> bytes:
    """Return the FMU of an amplifier in XML alone: its output follows its input u, at once or after a step.

    The attributes are those of the units: the exponents and the factor.
    """
    exponents = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    base = f"<BaseUnit {exponents}/>" if exponents else ""
    units = f'<UnitDefinitions><Unit name="{unit}">{base}</Unit></UnitDefinitions>' if unit else ""
    has = f' unit="{unit}"' if unit and kind == "Real" else ""
    changes = "continuous" if kind == "Real" else "discrete"
    start = "false" if kind == "Boolean" else "0"
    description = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="amplifier" guid="1">
  <CoSimulation modelIdentifier="amplifier"/>
  {units}
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="{changes}">
      <{kind}{has} start="{start}"/>
    </ScalarVariable>
    <ScalarVariable name="{output}" valueReference="1" causality="output" variability="{changes}">
      <{kind}{has}/>
    </ScalarVariable>
    <ScalarVariable name="k" valueReference="2" causality="parameter" variability="fixed">
      <Real min="0" max="10" start="1"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies="{"1" if follows else ""}"/></Outputs>
  </ModelStructure>
</fmiModelDescription>
"""
    files: Mapping[str, bytes] = {"modelDescription.xml": description.encode()}
    if terminals:
        files = {**files, "terminalsAndIcons/terminalsAndIcons.xml": terminals.encode()}
    return archive(files)
