"""Detached signatures of FMUs by Ed25519, in OpenSSH's format (PROTOCOL.sshsig), which ssh-keygen makes and checks too.

    ssh-keygen -Y check-novalidate -n rov-fmu -s videoray.fmu.sig < videoray.fmu

The library cryptography does the arithmetic. It is an extra, and imported only here.
"""

import base64
import binascii
import hashlib
import os
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rov_fmu.io.messages import FileError, InputError, ProofError
from rov_fmu.io.reading import hash_of, open_file, read_bytes

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

NAMESPACE = b"rov-fmu"
"""What the signatures are for. A signature for another purpose, such as a commit, is refused."""
_KIND, _MAGIC, _HASH = b"ssh-ed25519", b"SSHSIG", b"sha512"
_VERSION = (1).to_bytes(4, "big")
_BEGIN, _END = "-----BEGIN SSH SIGNATURE-----", "-----END SSH SIGNATURE-----"
_MOST_BYTES = 100_000
"""The largest size of a key or a signature."""
_MAKE_ONE = "must be an Ed25519 key, which `ssh-keygen -t ed25519 -f KEY` makes"


def signature_path(fmu: Path) -> Path:
    """Return the path of the signature of an FMU, which is beside it."""
    return Path(f"{fmu}.sig")


def check_library() -> None:
    """Raise InputError if the library cryptography is not installed."""
    try:
        import cryptography  # noqa: F401
    except ModuleNotFoundError as error:
        raise InputError("signatures need cryptography: pip install 'rov-fmu[sign]'") from error


def private_key(path: Path) -> "Ed25519PrivateKey":
    """Read a private key of OpenSSH or in PEM. Raises FileError, and InputError without the library."""
    check_library()
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key, load_ssh_private_key

    content = read_bytes(path, most=_MOST_BYTES)
    load = load_ssh_private_key if b"OPENSSH" in content else load_pem_private_key
    try:
        key = load(content, None)
    except (TypeError, ValueError, UnsupportedAlgorithm) as error:
        words = str(error).lower()
        if "password" in words or "encrypted" in words:
            raise FileError(f"{path}: has a passphrase; a key to sign with must have none") from error
        raise FileError(f"{path}: is not a private key: {_MAKE_ONE}") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise FileError(f"{path}: is a key of another kind: {_MAKE_ONE}")
    return key


def public_key(path: Path) -> bytes:
    """Read a public key of OpenSSH, the line in KEY.pub, or in PEM, and return its 32 bytes. Raises FileError."""
    check_library()
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key, load_ssh_public_key

    content = read_bytes(path, most=_MOST_BYTES)
    load = load_pem_public_key if b"BEGIN" in content else load_ssh_public_key
    try:
        key = load(content)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise FileError(f"{path}: is not a public key: {_MAKE_ONE}, beside it KEY.pub") from error
    if not isinstance(key, Ed25519PublicKey):
        raise FileError(f"{path}: is a key of another kind: {_MAKE_ONE}")
    return key.public_bytes_raw()


def signed(content: bytes, key: "Ed25519PrivateKey") -> bytes:
    """Return the file with the signature of some content. The same content and key give the same bytes."""
    public = _packed(_KIND, key.public_key().public_bytes_raw())
    signature = _packed(_KIND, key.sign(_message(hashlib.sha512(content).digest())))
    blob = _MAGIC + _VERSION + _packed(public, NAMESPACE, b"", _HASH, signature)
    lines = textwrap.wrap(base64.b64encode(blob).decode(), 70)
    return "\n".join([_BEGIN, *lines, _END, ""]).encode()


def check_signature(fmu: Path, key: Path | None = None) -> str:
    """Check the signature beside an FMU, and return the fingerprint of the key that made it, as ssh-keygen -l shows it.

    Without a signature, the fingerprint is empty. `key` is the file of the public key that must have made it.

    Raises ProofError if the signature does not fit, or if there is none although there is a `key`; FileError if a file
    cannot be read; InputError without the library.
    """
    path = signature_path(fmu)
    if not os.path.lexists(path):  # a link that leads nowhere is no FMU without a signature
        if key:
            raise ProofError(f"{fmu}: is not signed: there is no file {path}")
        return ""
    check_library()
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    public, signature = _read(path)
    with open_file(fmu) as file:
        digest = hash_of(file, _HASH.decode())
    try:
        Ed25519PublicKey.from_public_bytes(public).verify(signature, _message(digest))
    except (InvalidSignature, ValueError) as error:
        reason = "the FMU was altered or built again after it was signed"
        raise ProofError(f"{fmu}: the signature {path} does not fit: {reason}") from error
    fingerprint = _fingerprint(public)
    if key and (wanted := public_key(key)) != public:
        raise ProofError(f"{fmu}: is signed by another key, {fingerprint}, and not by {key}, {_fingerprint(wanted)}")
    return fingerprint


def _read(path: Path) -> tuple[bytes, bytes]:
    """Return the public key and the signature in a file. Raises FileError."""
    try:
        lines = read_bytes(path, most=_MOST_BYTES).decode("ascii").split()
        text = " ".join(lines)
        if not (text.startswith(_BEGIN) and text.endswith(_END)):
            raise ValueError
        blob = base64.b64decode(text[len(_BEGIN) : -len(_END)].replace(" ", ""), validate=True)
        head = _MAGIC + _VERSION
        public, namespace, _, by_hash, signature = _parts(blob.removeprefix(head))
        (kind, key), (kind_of_signature, value) = _parts(public), _parts(signature)
        is_ours = blob.startswith(head) and (namespace, by_hash) == (NAMESPACE, _HASH)
        if not is_ours or (kind, kind_of_signature) != (_KIND, _KIND):
            raise ValueError
    except (ValueError, binascii.Error) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(
            f"{path}: is not a signature by Ed25519 for {NAMESPACE.decode()}, in OpenSSH's format"
        ) from error
    return key, value


def _message(digest: bytes) -> bytes:
    """Return what is signed, for the SHA-512 of the FMU."""
    return _MAGIC + _packed(NAMESPACE, b"", _HASH, digest)


def _fingerprint(public: bytes) -> str:
    digest = hashlib.sha256(_packed(_KIND, public)).digest()
    return f"SHA256:{base64.b64encode(digest).decode().rstrip('=')}"


def _packed(*parts: bytes) -> bytes:
    """Return some bytes, each with its length before it."""
    return b"".join(len(part).to_bytes(4, "big") + part for part in parts)


def _parts(packed: bytes) -> Iterator[bytes]:
    """Yield the parts that `_packed` joined. Raises ValueError."""
    while packed:
        length = int.from_bytes(packed[:4], "big")
        if len(packed) < 4 + length:
            raise ValueError("a part is cut off")
        yield packed[4 : 4 + length]
        packed = packed[4 + length :]
