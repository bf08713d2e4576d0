"""Writing files completely or not at all."""

import errno
import hashlib
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rov_fmu.io.file_kinds import check_written
from rov_fmu.io.interrupts import UNINTERRUPTED, cleaned_up
from rov_fmu.io.messages import FileError, RovError
from rov_fmu.io.paths import is_own_file, own_folder
from rov_fmu.io.reading import open_file, read_text


class WriteError(RovError, OSError):
    """A path that cannot be written."""


@dataclass(frozen=True)
class Output:
    """A file to write."""

    path: Path
    content: bytes
    check: Callable[[Path], None] = lambda _: None
    """A function that raises an exception if the written draft of the file is wrong."""


def check_targets(
    targets: Iterable[tuple[Path | None, str]],
    inputs: Iterable[Path] = (),
    *,
    force: bool,
    is_ours: Callable[[Path], bool] = lambda _: False,
) -> dict[Path, str]:
    """Check the files that a command will write, and return what each of them replaces: an empty text for nothing.

    - `targets`: the paths, each with its kind (`file_kinds`), or an empty text. None is no file.
    - `inputs`: the files that the command reads.
    - `force`: True to replace any other file, and not only those of this program that nobody has changed since.
    - `is_ours`: tells whether a file proves itself that it is as this program wrote it.

    Raises FileError about a suffix of another kind, and WriteError about the first path that cannot be written, that is
    an input or another target, or whose file may not be replaced. Of a link, only the link is replaced.
    """
    taken, kinds = list(inputs), [(path, kind) for path, kind in targets if path]
    for path, kind in kinds:
        _check_target(path, taken)
        if kind:
            check_written(path, kind)
        taken.append(path)
    return {path: _replaced(path, is_ours, force=force) for path, _ in kinds}


def _check_target(path: Path, taken: Iterable[Path]) -> None:
    """Raise WriteError if no file can be written at a path, or if it is taken."""
    if path.is_dir():
        raise WriteError(errno.EISDIR, "is a folder, not a file to write", str(path))
    if not path.parent.is_dir():
        raise WriteError(errno.ENOENT, f"there is no folder {path.parent}", str(path))
    if path.exists() and not path.is_file():
        raise WriteError(errno.EINVAL, "is a device or a pipe, and cannot be replaced by a file", str(path))
    if path.exists() and not os.access(path, os.W_OK):
        raise WriteError(errno.EACCES, "is read-only", str(path))
    _check_folder(path)
    for other in taken:
        if is_same(path, other):
            raise WriteError(errno.EEXIST, f"would overwrite {other}, an input or another output", str(path))


def _check_folder(path: Path) -> None:
    """Raise WriteError if no new file can be made in the folder of a path. Only an attempt shows this."""
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        reason = f"no new file can be made in the folder {path.parent}"
        if error.errno in (errno.EACCES, errno.EROFS):
            reason = "its folder is read-only"
        elif error.errno != errno.ENOENT:
            reason += f": {error.strerror}"
        raise WriteError(error.errno, reason, str(path)) from error


def write_whole(
    *outputs: Output, force: bool = False, is_ours: Callable[[Path], bool] = lambda _: False
) -> dict[Path, str]:
    """Write all files, once their drafts have passed the checks, or none of them. Return what each file replaced.

    Existing files are replaced by the rule of `check_targets`. If a path is a link, the link is replaced and its
    target stays. Raises WriteError about a path that cannot be written, and whatever a check raises.
    """
    replaced = check_targets([(output.path, "") for output in outputs], force=force, is_ours=is_ours)
    put_whole(*outputs)
    _remember(outputs)
    return replaced


def put_whole(*outputs: Output) -> None:
    """Write all files of a folder of this program's own, whatever is there, or none of them.

    Raises WriteError, and whatever a check raises.
    """
    with ExitStack() as drafts:
        ready = [(output.path, _draft(output, drafts)) for output in outputs]
        with UNINTERRUPTED:
            for path, draft in ready:
                with _errors_about(path):
                    draft.replace(path)


def kept(folder: Path, key: str, make: Callable[[], bytes]) -> Path:
    """Return the file that a cache folder has under a key. It is made if it is missing or damaged.

    Its name has the key, which says what the content depends on, and a digest of the content. Raises OSError if the
    folder cannot be used (`own_folder`), and what `make` raises.
    """
    own = own_folder(folder)
    for path in own.glob(f"{key}-*"):
        if is_own_file(path) and path.name == _kept_name(key, path.read_bytes()):
            return path
    content = make()
    path = own / _kept_name(key, content)  # another process may write the same file at the same time
    if path.is_symlink() or (path.exists() and not is_own_file(path)):
        path.unlink()
    put_whole(Output(path, content))
    path.chmod(0o600)  # whatever the umask is
    return path


def _kept_name(key: str, content: bytes) -> str:
    return f"{key}-{hashlib.sha256(content).hexdigest()[:32]}"


def _draft(output: Output, drafts: ExitStack) -> Path:
    """Write and check a draft beside the target. It is removed when the stack closes, unless it has been moved."""
    path = output.path
    with _errors_about(path):
        with UNINTERRUPTED:
            descriptor, name = tempfile.mkstemp(prefix=f".{path.name[:40]}.", suffix=".part", dir=path.parent)
            draft = Path(name)
            drafts.enter_context(cleaned_up(partial(draft.unlink, missing_ok=True)))
        with os.fdopen(descriptor, "wb") as file:
            file.write(output.content)
            file.flush()
            os.fsync(file.fileno())
    output.check(draft)
    with _errors_about(path):
        mask = os.umask(0)
        os.umask(mask)
        draft.chmod(0o666 & ~mask)  # the permissions that open() would give
    return draft


def is_same(path: Path, other: Path) -> bool:
    """Return True if two paths lead to the same file, whether or not it exists."""
    if path.exists() and other.exists():
        return path.samefile(other)
    return os.path.realpath(path) == os.path.realpath(other)


@contextmanager
def _errors_about(path: Path) -> Iterator[None]:
    """Raise WriteError about the path instead of any OSError in the block."""
    try:
        yield
    except OSError as error:
        raise WriteError(error.errno, error.strerror, str(path)) from error


# ---- Whose file it is ------------------------------------------------------------------------------------------------
#
# A file may be replaced if this program wrote it and nobody has changed it since. It proves this itself, by a digest in
# its first line, or as an archive does by one in its comment. Any other file, such as a table or a picture, is in the
# list of what this program wrote on this machine. All others are replaced with `force` alone.

_WRITTEN = "written"
"""The list in the user's cache folder: a line for each file, the digest of its path and its content."""
_LONGEST_LIST = 1_000_000
"""The size of the list, in bytes, above which its older half is forgotten."""
_SEAL = re.compile(r"(?:#|<!--) rov-fmu(?: \w+)? wrote this file\. SHA-256 of the lines below: (\w{64})(?: -->)?")
_XML = re.compile(r"<\?xml[^\n]*\n")
"""The line that must be the first one of a file in XML. The seal stands below it."""


def sealed(text: str, command: str = "") -> str:
    """Return the text of a page, a file in XML or in TOML with a line at its beginning that has its digest."""
    head = match[0] if (match := _XML.match(text)) else ""
    text = text.removeprefix(head)
    words = f"{f'rov-fmu {command}'.strip()} wrote this file. SHA-256 of the lines below: {_digest(text)}"
    return f"{head}{f'<!-- {words} -->' if text.startswith('<') else f'# {words}'}\n{text}"


def without_seal(text: str) -> str:
    """Return the text without the first line that `sealed` adds, because it is about to be changed."""
    first, _, rest = text.partition("\n")
    return rest if _SEAL.fullmatch(first) else text


def _replaced(path: Path, is_ours: Callable[[Path], bool], *, force: bool) -> str:
    """Return which file at a path will be replaced, in words. Raises WriteError as `check_targets` does."""
    if path.is_symlink():
        return "a link"
    if not path.exists():
        return ""
    foreign = "" if (reason := _foreign(path)) and (is_ours(path) or _is_remembered(path)) else reason
    if foreign and not force:
        raise WriteError(errno.EEXIST, f"the file there {foreign}; --force replaces it", str(path))
    return f"a file that {foreign}" if foreign else "the result of an earlier run"


def _foreign(path: Path) -> str:
    """Return why a file may be the work of somebody else, or an empty text if it is as this program wrote it."""
    try:
        with open_file(path) as file:
            begins = _XML.sub("", file.read(500).decode(errors="replace").removeprefix("\ufeff"), count=1)
        if not (seal := _SEAL.match(begins)):
            return "has no mark of rov-fmu: it may have been made or changed by hand"
        below = _XML.sub("", read_text(path), count=1).partition("\n")[2]
        return "" if seal[1] == _digest(below) else "has changed since rov-fmu wrote it"
    except FileError as error:
        return str(error).removeprefix(f"{path}: ")


def _line(path: Path, content: bytes) -> str:
    """Return the line about a file in the list of what was written."""
    return hashlib.sha256(f"{os.path.realpath(path)}\0".encode(errors="surrogatepass") + content).hexdigest()


def _list() -> Path:
    """Return the list of what was written. Raises OSError if another user could change it."""
    from platformdirs import user_cache_path  # imported here, because few commands need it

    return own_folder(user_cache_path("rov-fmu", appauthor=False)) / _WRITTEN


def _remember(outputs: Iterable[Output]) -> None:
    """Add files to the list. Without a cache folder, they are replaced with `force` alone."""
    with suppress(OSError):
        path, lines = _list(), "".join(f"{_line(output.path, output.content)}\n" for output in outputs)
        if path.exists() and path.stat().st_size > _LONGEST_LIST:
            before = path.read_text("ascii").splitlines(keepends=True)
            put_whole(Output(path, "".join([*before[len(before) // 2 :], lines]).encode()))
            return
        with path.open("a", encoding="ascii") as file:
            file.write(lines)


def _is_remembered(path: Path) -> bool:
    """Return True for a file that is as this program wrote it, by the list."""
    with suppress(OSError):
        return _line(path, path.read_bytes()) in _list().read_text("ascii").split()
    return False


def _digest(text: str) -> str:
    """Return the SHA-256 of a text in hexadecimal."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()
