"""lxml: validate every XML document of the FMU against the schema of the standard, which FMPy ships."""

from pathlib import Path
from zipfile import ZipFile

import fmpy
from lxml import etree

from verification.interoperability.runners.flight import FMU

SCHEMAS = Path(fmpy.__file__).with_name("schema")
# The schemas of the other documents. FMI 2.0.4 took its terminals from FMI 3.0.
SCHEMA = {
    "sources/buildDescription.xml": "fmi3/fmi3BuildDescription.xsd",
    "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
}

with ZipFile(FMU) as archive:
    version = etree.fromstring(archive.read("modelDescription.xml")).get("fmiVersion").partition(".")[0]
    schemas = {"modelDescription.xml": f"fmi{version}/fmi{version}ModelDescription.xsd", **SCHEMA}
    for name in archive.namelist():
        if name.endswith(".xml") and not name.startswith("extra/"):  # files of layered standards have no schema
            schema = etree.XMLSchema(file=str(SCHEMAS / schemas[name]))
            schema.assertValid(etree.fromstring(archive.read(name)))
            print(f"{name} follows {schemas[name]}")
