"""The digests that an FMU carries of its own parts, beside those of what is really there."""

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rov_fmu.fmu.archive import REPORT, guid_of
from rov_fmu.io.output import seal_of


@dataclass(frozen=True)
class Digest:
    """A part of an FMU, the digest that the FMU claims for it, and the actual one."""

    part: str
    method: str
    claimed: str
    actual: str

    @property
    def agrees(self) -> bool:
        """True when the part is as it was."""
        return self.claimed == self.actual


def digests(fmu: Path) -> Iterator[Digest]:
    """Yield what an FMU of ours says about its parts: by its GUID, and by the first line of files that have a digest.

    The GUID is a digest of the description and of the sources. A binary refuses another GUID than its own.
    """
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if _is_digested(name)}
    if guid := guid_of(files):
        yield Digest("modelDescription.xml and sources", "GUID", *guid)
    for name, content in sorted(files.items()):
        if seal := seal_of(content.decode(errors="replace")):
            yield Digest(name, "SHA-256", *seal)


def _is_digested(name: str) -> bool:
    """Return True for a file that may have a digest, or be part of one."""
    own = ("modelDescription.xml", f"documentation/{REPORT}")
    return name in own or name.startswith(("sources/", "resources/")) or name.endswith(".toml")
