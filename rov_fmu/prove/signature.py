"""Detached signatures of FMUs in OpenSSH's format (PROTOCOL.sshsig), which the program ssh-keygen makes and checks.

ssh-keygen -Y check-novalidate -n rov-fmu -s videoray.fmu.sig < videoray.fmu
"""

import os
import re
import subprocess
from pathlib import Path
from typing import IO

from rov_fmu.io.messages import FileError, InputError, ProofError
from rov_fmu.io.reading import open_file, read_bytes

_NAMESPACE = "-n", "rov-fmu"
"""What the signatures are for. A signature for another purpose, such as a commit, is refused."""
_MOST_BYTES = 100_000
"""The largest size of a key or a signature."""
_SECONDS = 60.0
"""The longest time that ssh-keygen may take."""
_MAKE_ONE = "`ssh-keygen -t ed25519 -f KEY` makes one"


def signature_path(fmu: Path) -> Path:
    """Return the path of the signature of an FMU, which is beside it."""
    return Path(f"{fmu}.sig")


def check_private_key(path: Path) -> None:
    """Raise FileError if nothing can be signed with a key, and InputError without ssh-keygen."""
    read_bytes(path, most=_MOST_BYTES)
    done = _ssh_keygen("-y", "-P", "", "-f", path.absolute())
    if done.returncode:
        reasons = {
            b"passphrase": "has a passphrase; a key to sign with must have none",
            b"permissions": "others may read it: a private key must be for its owner alone (chmod 600)",
        }
        unusable = f"is not a private key of OpenSSH: {_MAKE_ONE}"
        raise FileError(f"{path}: {next((words for kind, words in reasons.items() if kind in done.stderr), unusable)}")


def signed(content: bytes, key: Path) -> bytes:
    """Return the file with the signature of some content. The same content and key of Ed25519 give the same bytes."""
    done = _ssh_keygen("-Y", "sign", "-q", *_NAMESPACE, "-f", key.absolute(), content=content)
    if done.returncode:
        raise FileError(f"{key}: ssh-keygen cannot sign with this key")
    return done.stdout.replace(b"\r\n", b"\n")


def check_signature(fmu: Path, key: Path | None = None) -> str:
    """Check the signature beside an FMU, and return the fingerprint of the key that made it, as ssh-keygen -l shows it.

    Without a signature, the fingerprint is empty. `key` is the file of the public key that must have made it.

    Raises ProofError if the signature does not fit, or if there is none although there is a `key`; FileError if a file
    cannot be read; InputError without ssh-keygen.
    """
    path = signature_path(fmu)
    if not os.path.lexists(path):  # a link that leads nowhere is no FMU without a signature
        if key:
            raise ProofError(f"{fmu}: is not signed: there is no file {path}")
        return ""
    read_bytes(path, most=_MOST_BYTES)
    with open_file(fmu) as file:
        done = _ssh_keygen("-Y", "check-novalidate", *_NAMESPACE, "-s", path.absolute(), file=file)
    if b"incorrect signature" in done.stderr:
        reason = "the FMU was altered or built again after it was signed"
        raise ProofError(f"{fmu}: the signature {path} does not fit: {reason}")
    if not (fingerprint := _fingerprint(done)):
        raise FileError(f"{path}: is not a signature for rov-fmu, in OpenSSH's format")
    if key:
        read_bytes(key, most=_MOST_BYTES)
        if not (wanted := _fingerprint(_ssh_keygen("-l", "-f", key.absolute()))):
            raise FileError(f"{key}: is not a public key of OpenSSH: {_MAKE_ONE}, beside it KEY.pub")
        if wanted != fingerprint:
            raise ProofError(f"{fmu}: is signed by another key, {fingerprint}, and not by {key}, {wanted}")
    return fingerprint


def _fingerprint(done: "subprocess.CompletedProcess[bytes]") -> str:
    """Return the fingerprint that ssh-keygen printed; empty if it failed."""
    match = re.search(rb"SHA256:[\w+/]{43}", done.stdout)
    return match[0].decode() if match and not done.returncode else ""


def _ssh_keygen(
    *arguments: str | Path, content: bytes | None = None, file: IO[bytes] | None = None
) -> "subprocess.CompletedProcess[bytes]":
    """Run ssh-keygen on some content, or on a file. It asks for no passphrase. Raises InputError if it cannot run."""
    try:
        return subprocess.run(
            ["ssh-keygen", *map(str, arguments)],
            stdin=None if content is not None else file or subprocess.DEVNULL,
            input=content,
            capture_output=True,
            timeout=_SECONDS,
            env={**os.environ, "LC_ALL": "C", "SSH_ASKPASS": "", "SSH_ASKPASS_REQUIRE": "force"},
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError("signatures need the program ssh-keygen, a part of OpenSSH 8.2 or later") from error
