"""lxml: every XML document of the FMU against the schema that the standard has for it, as FMPy ships them."""

from pathlib import Path
from zipfile import ZipFile

import fmpy
from lxml import etree

from verification.interoperability.runners.flight import FMU

SCHEMAS = Path(fmpy.__file__).with_name("schema")
# Beside modelDescription.xml; FMI 2.0.4 took its terminals from FMI 3.0.
SCHEMA = {
    "sources/buildDescription.xml": "fmi3/fmi3BuildDescription.xsd",
    "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
}

with ZipFile(FMU) as archive:
    version = etree.fromstring(archive.read("modelDescription.xml")).get("fmiVersion").partition(".")[0]
    schemas = {"modelDescription.xml": f"fmi{version}/fmi{version}ModelDescription.xsd", **SCHEMA}
    for name in archive.namelist():
        if name.endswith(".xml") and not name.startswith("extra/"):  # layered standards: not the standard's
            schema = etree.XMLSchema(file=str(SCHEMAS / schemas[name]))
            schema.assertValid(etree.fromstring(archive.read(name)))
            print(f"{name} follows {schemas[name]}")
