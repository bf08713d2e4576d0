"""A system of one ROV with its parameters, as SSP 1.0 and as an OSP configuration."""

from pathlib import Path
from zipfile import ZipFile

from interop.runners.flight import FMU, OUTPUTS, parameters, steps

SSD = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="dive" version="1.0"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
  <ssd:System name="dive">
    <ssd:Elements>
      <ssd:Component name="rov" source="resources/{fmu}" type="application/x-fmu-sharedlibrary">
        <ssd:Connectors>
          {connectors}
        </ssd:Connectors>
        <ssd:ParameterBindings>
          <ssd:ParameterBinding source="resources/manoeuvre.ssv" type="application/x-ssp-parameter-set"/>
        </ssd:ParameterBindings>
      </ssd:Component>
    </ssd:Elements>
  </ssd:System>
</ssd:SystemStructureDescription>
"""
SSV = """<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet name="manoeuvre" version="1.0"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
  <ssv:Parameters>
    {parameters}
  </ssv:Parameters>
</ssv:ParameterSet>
"""
OSP = """<?xml version="1.0" encoding="UTF-8"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
  <BaseStepSize>0.1</BaseStepSize>
  <Algorithm>fixedStep</Algorithm>
  <Simulators>
    <Simulator name="rov" source="{fmu}">
      <InitialValues>
        {parameters}
      </InitialValues>
    </Simulator>
  </Simulators>
</OspSystemStructure>
"""


def write_ssp(path: str) -> None:
    """Write the SSP archive."""
    kinds = {**dict.fromkeys(next(steps()).inputs, "input"), **dict.fromkeys(OUTPUTS, "output")}
    connectors = (f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
                  for name, kind in kinds.items())  # fmt: skip
    values = (f'<ssv:Parameter name="{name}"><ssv:Real value="{value!r}"/></ssv:Parameter>'
              for name, value in parameters().items())  # fmt: skip
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", SSD.format(fmu=FMU, connectors="\n          ".join(connectors)))
        archive.writestr("resources/manoeuvre.ssv", SSV.format(parameters="\n    ".join(values)))
        archive.write(FMU, f"resources/{FMU}")


def write_osp(path: str) -> None:
    """Write the OSP configuration; it refers to the FMU beside it."""
    values = (f'<InitialValue variable="{name}"><Real value="{value!r}"/></InitialValue>'
              for name, value in parameters().items())  # fmt: skip
    Path(path).write_text(OSP.format(fmu=FMU, parameters="\n        ".join(values)))
