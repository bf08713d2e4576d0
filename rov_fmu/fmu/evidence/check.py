"""Whether an FMU is as it was built: the hashes in its meta-data, and the signature beside it."""

import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from lxml import etree

from rov_fmu.fmu.evidence.meta_data import FILES, GENERATOR, INPUTS, META_DATA, own_hash
from rov_fmu.fmu.evidence.signature import check_signature
from rov_fmu.fmu.unpacking import refusal
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.messages import FileError, ProofError, brief, shown
from rov_fmu.io.reading import hash_of, open_file, root_of_xml

_MOST_BYTES = 20_000_000
"""The largest size of the meta-data."""


@dataclass(frozen=True)
class MetaData:
    """What the meta-data and the signature of an FMU say. All of it has been checked."""

    files: Mapping[str, str] = field(default_factory=dict)
    """The SHA3-256 of each file of the FMU by its path; none if the FMU has no meta-data of this project."""
    inputs: Mapping[str, str] = field(default_factory=dict)
    """The hash of each file that identification read, by its name: `SHA3-256: 5f1c...`."""
    generator: Mapping[str, str] = field(default_factory=dict)
    """The SHA3-256 of the program that built the FMU, by its name and version."""
    signer: str = ""
    """The fingerprint of the key that signed the FMU; empty if there is no signature."""


def check_evidence(fmu: Path, key: Path | None = None) -> MetaData:
    """Check the hashes in an FMU and the signature beside it. An FMU of another exporter may have neither.

    `key` is the file of a public key. With it, the FMU must be signed by this key.

    Raises ProofError with one line that names the first part that is not as it was built, or if the signature does not
    fit; FileError if a file cannot be read; InputError if there is a signature and no library to check it.
    """
    check_suffix(fmu, FMU)
    evidence = MetaData()
    try:
        with open_file(fmu) as file, zipfile.ZipFile(file) as archive:
            if reason := refusal(archive):
                raise FileError(f"{fmu}: {reason}")
            if META_DATA in archive.namelist():
                evidence = _read(fmu, archive)
                if evidence != MetaData() and (change := next(_changes(archive, evidence.files), "")):
                    raise ProofError(f"{fmu}: {change}")
    except (FileError, ProofError):
        raise
    except Exception as error:  # zipfile raises many kinds on damaged archives
        raise FileError(f"{fmu}: is not an FMU, or is damaged: {brief(str(error))}") from error
    return replace(evidence, signer=check_signature(fmu, key))


def _read(fmu: Path, archive: zipfile.ZipFile) -> MetaData:
    """Return what the meta-data say. Raises FileError."""
    where = f"{fmu}: {META_DATA}"
    if (size := archive.getinfo(META_DATA).file_size) > _MOST_BYTES:
        raise FileError(f"{where}: has {size / 1e6:.3g} MB; at most {_MOST_BYTES / 1e6:g} MB are read")
    try:
        root = root_of_xml(archive.read(META_DATA))
    except (etree.XMLSyntaxError, zipfile.BadZipFile) as error:
        raise FileError(f"{where}: is damaged: {brief(str(error))}") from error
    entries = {
        classification.get("type"): {
            entry.get("keyword", ""): (entry.text or "").strip()
            for entry in classification.iterfind("{*}ClassificationEntry")
        }
        for classification in root.iterfind("{*}Classification")
    }
    return MetaData(entries.get(FILES, {}), entries.get(INPUTS, {}), entries.get(GENERATOR, {}))


def _changes(archive: zipfile.ZipFile, files: Mapping[str, str]) -> Iterator[str]:
    """Yield a line about each file that is not what the meta-data say; the meta-data themselves come first."""
    members = [name for name in archive.namelist() if not name.endswith("/")]
    for name, times in Counter(archive.namelist()).items():
        if times > 1:
            yield f"{shown(name)} is {times} times in the archive"
    for name in sorted({*members, *files}, key=lambda name: (name != META_DATA, name)):
        if name not in members:
            yield f"{shown(name)} is missing; it was there when the FMU was built"
        elif name not in files and name != META_DATA:
            yield f"{shown(name)} was added after the FMU was built"
        elif (digest := _hash(archive, name)) != (given := files.get(name, "unknown")):
            differs = f"its SHA3-256 is {digest[:16]}…, and was {given[:16]}…" if digest else "it is damaged"
            yield f"{shown(name)} was altered after the FMU was built: {differs}"


def _hash(archive: zipfile.ZipFile, name: str) -> str:
    """Return the SHA3-256 of a file in the archive, or an empty text if it cannot be unpacked."""
    try:
        with archive.open(name) as file:
            return own_hash(file.read()) if name == META_DATA else hash_of(file, "sha3_256").hex()
    except Exception:  # zipfile raises many kinds on damaged archives
        return ""
