"""Whether an FMU is as it was built: the hashes in its meta-data, and the signature beside it."""

import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from rov_fmu.fmu.archive import META_DATA, directory, local_header
from rov_fmu.fmu.meta_data import ARCHIVE, BEFORE, FILES, GENERATOR, INPUTS, own_hash
from rov_fmu.fmus.unpacking import check_order, opened_archive
from rov_fmu.io.file_kinds import FMU, check_suffix
from rov_fmu.io.messages import ProofError, brief, shown
from rov_fmu.io.reading import check_size, hash_of, open_file, root_of_xml
from rov_fmu.prove.signature import check_signature

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
    before: str = ""
    """The SHA3-256 of the bytes of the archive before the meta-data."""
    signer: str = ""
    """The fingerprint of the key that signed the FMU; empty if there is no signature."""

    @property
    def words(self) -> str:
        """What the hashes and the signature say."""
        if self.signer:
            return f"All {len(self.files)} files are as they were built. Signed with the key {self.signer}."
        if self.files:
            return f"All {len(self.files)} files match the hashes in the FMU, which is not signed."
        return "The FMU has no hashes of its files, and it is not signed: nothing shows who made it, or a change."


def check_evidence(fmu: Path, key: Path | None = None) -> MetaData:
    """Check the hashes in an FMU and the signature beside it. An FMU of another exporter may have neither.

    `key` is the file of a public key. With it, the FMU must be signed by this key.

    Raises ProofError with one line that names the first part that is not as it was built, or if the signature does not
    fit; FileError if a file cannot be read; InputError if there is a signature and no library to check it.
    """
    check_suffix(fmu, FMU)
    evidence = MetaData()
    with open_file(fmu) as file, opened_archive(file, fmu) as archive:
        if META_DATA in archive.namelist():
            evidence = _read(fmu, archive)
            if evidence != MetaData() and (change := next(_changes(archive, evidence), "")):
                raise ProofError(f"{fmu}: {change}")
        check_order(archive, fmu)
    return replace(evidence, signer=check_signature(fmu, key))


def _read(fmu: Path, archive: zipfile.ZipFile) -> MetaData:
    """Return what the meta-data say. Raises FileError."""
    where = f"{fmu}: {META_DATA}"
    check_size(f"{where}:", archive.getinfo(META_DATA).file_size, _MOST_BYTES)
    try:
        root = root_of_xml(archive.read(META_DATA))
    except (ValueError, zipfile.BadZipFile) as error:
        raise ProofError(f"{where}: was altered after the FMU was built: {brief(str(error))}") from error
    entries = {
        classification.get("type"): {
            entry.get("keyword", ""): (entry.text or "").strip()
            for entry in classification.iterfind("{*}ClassificationEntry")
        }
        for classification in root.iterfind("{*}Classification")
    }
    files, inputs, generator = (entries.get(kind, {}) for kind in (FILES, INPUTS, GENERATOR))
    return MetaData(files, inputs, generator, entries.get(ARCHIVE, {}).get(BEFORE, ""))


def _changes(archive: zipfile.ZipFile, evidence: MetaData) -> Iterator[str]:
    """Yield a line about each file that is not what the meta-data say; the meta-data themselves come first.

    Then follows a line if other bytes are not those that the builder writes, such as a date or an attribute.
    """
    members, files = [name for name in archive.namelist() if not name.endswith("/")], evidence.files
    for name in sorted({*members, *files}, key=lambda name: (name != META_DATA, name)):
        if name not in members:
            yield f"{shown(name)} is missing; it was there when the FMU was built"
        elif name not in files and name != META_DATA:
            yield f"{shown(name)} was added after the FMU was built"
        elif (digest := _hash(archive, name)) != (given := files.get(name, "unknown")):
            differs = f"its SHA3-256 is {digest[:16]}…, and was {given[:16]}…" if digest else "it is damaged"
            yield f"{shown(name)} was altered after the FMU was built: {differs}"
    entry, file = archive.getinfo(META_DATA), archive.fp
    assert file
    expected = local_header(entry) + archive.read(entry) + directory(archive.infolist())
    file.seek(0)
    before = hash_of(file, "sha3_256", entry.header_offset).hex()
    if before != evidence.before or file.read(len(expected) + 1) != expected:
        yield (
            "the archive was altered after the FMU was built, although its files are the same"
            if evidence.before
            else "the archive has no hash, because an earlier rov-fmu built it: build it again"
        )


def _hash(archive: zipfile.ZipFile, name: str) -> str:
    """Return the SHA3-256 of a file in the archive, or an empty text if it cannot be unpacked."""
    try:
        with archive.open(name) as file:
            return own_hash(file.read()) if name == META_DATA else hash_of(file, "sha3_256").hex()
    except Exception:  # zipfile raises many kinds on damaged archives
        return ""
