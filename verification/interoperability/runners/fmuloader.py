"""fmuloader, Co-Simulation, FMI 2.0 and 3.0: the state is saved as bytes and restored once.

fmuloader calls the functions of the library but does not read modelDescription.xml, so this program does.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from fmuloader.fmi3 import Fmi3Slave

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, detour, fly, parameters

description = ElementTree.fromstring(ZipFile(FMU).read("modelDescription.xml"))
reference = {v.attrib["name"]: int(v.attrib["valueReference"]) for v in description.iterfind("ModelVariables/*")}
(identifier,) = {of.attrib["modelIdentifier"] for of in description.iter("CoSimulation")}


def instantiated() -> tuple[Any, Any, Any]:
    """Return an instance, and its functions that get and set values."""
    if description.attrib["fmiVersion"] == "2.0":
        two = Fmi2Slave(FMU, model_identifier=identifier)
        two.instantiate("rov", Fmi2Type.CO_SIMULATION, guid=description.attrib["guid"])
        two.setup_experiment(start_time=0.0)
        return two, two.get_real, two.set_real
    three = Fmi3Slave(FMU, model_identifier=identifier)
    three.instantiate_co_simulation("rov", instantiation_token=description.attrib["instantiationToken"])
    return three, three.get_float64, three.set_float64


rov, get_by, set_by = instantiated()


def put(values: Mapping[str, float]) -> None:
    set_by([reference[name] for name in values], list(values.values()))


def advance(step: Step) -> None:
    if step.detour:
        state = rov.get_fmu_state()
        kept = rov.serialize_fmu_state(state)
        rov.free_fmu_state(state)
        put(detour())
        rov.do_step(step.start, 1.0)
        state = rov.deserialize_fmu_state(kept)
        rov.set_fmu_state(state)
        rov.free_fmu_state(state)
    put(step.inputs)
    rov.do_step(step.start, step.length)


put(parameters())
rov.enter_initialization_mode()
rov.exit_initialization_mode()
fly(advance, partial(get_by, [reference[name] for name in OUTPUTS]))
rov.terminate()
rov.free_instance()
