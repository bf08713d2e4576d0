"""The fuzzer: built, run on several processors at once, its findings and its corpus kept."""

import os
import subprocess
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from rov_fmu.fmu.archive import archive
from verification.references.c_programs import compile_c
from verification.references.legal import legal_header

TARGET_SOURCE = Path(__file__).with_name("c") / "target.c"
CORPUS = Path(__file__).with_name("corpus.zip")
_LONGEST_INPUT = 2000  # bytes, some hundred calls
_LONGEST_TIME = 60  # s for one of them


class FindingError(Exception):
    """A sanitizer's report or a broken property: what was said, and the inputs that lead there."""

    def __init__(self, words: str, inputs: Sequence[Path] = ()) -> None:
        super().__init__(words)
        self.inputs = inputs


Counts = Counter[tuple[str, bool]]
"""Calls by function and whether they were accepted."""


def build_target(sources: Mapping[str, str], output: Path, fmi: int = 2) -> None:
    """Compile the fuzzer for the sources of an FMU, with AddressSanitizer and UndefinedBehaviorSanitizer."""
    compile_c(TARGET_SOURCE, output, {**sources, "legal.h": legal_header(fmi)}, sanitizers="fuzzer,address,undefined")


def unpack_corpus(folder: Path) -> None:
    """Write the inputs that are kept, one file each, into a folder."""
    with zipfile.ZipFile(CORPUS) as kept:
        kept.extractall(folder)


def pack_corpus(targets: Sequence[Path], folder: Path) -> int:
    """Keep of a folder of inputs those that together reach all that it reaches in any of the targets; how many."""
    kept: dict[str, bytes] = {}
    for target in targets:
        smaller = folder.with_name(f"{target.name}.smaller")
        smaller.mkdir()
        arguments = ["-merge=1", "-use_counters=0", str(smaller), str(folder)]
        _finish(_start(target, folder.parent, arguments), folder.parent)
        kept |= {path.name: path.read_bytes() for path in smaller.iterdir()}
    CORPUS.write_bytes(archive(kept))
    return len(kept)


def replay(target: Path, inputs: Sequence[Path], folder: Path) -> Counts:
    """Run files of input, or folders of them, once each. Raises FindingError."""
    return _finish(_start(target, folder, ["-runs=0", *map(str, inputs)]), folder)


def fuzz(target: Path, corpus: Path, folder: Path, seconds: int, jobs: int) -> Counts:
    """Fuzz for so long in so many processes that share a corpus. Raises FindingError."""
    arguments = [
        str(corpus),
        f"-max_total_time={seconds}",
        f"-max_len={_LONGEST_INPUT}",
        f"-timeout={_LONGEST_TIME}",
        f"-report_slow_units={_LONGEST_TIME}",  # no file for what is slow but ends
        "-len_control=0",
        "-reload=1",
    ]
    started = [_start(target, folder, arguments, name=f"counts-{i}") for i in range(jobs)]
    counts = Counts()
    try:
        for job in started:
            counts.update(_finish(job, folder))
    finally:
        for process, _, _ in started:
            process.kill()
            process.wait()
    return counts


_Job = tuple[subprocess.Popen[bytes], Path, Path]


def _start(target: Path, folder: Path, arguments: Sequence[str], name: str = "counts") -> _Job:
    counts, log = folder / name, folder / f"{name}.log"
    counts.unlink(missing_ok=True)
    with log.open("wb") as output:
        process = subprocess.Popen(
            [target, *arguments, f"-artifact_prefix={folder}{os.sep}finding-"],
            env={**os.environ, "FUZZ_COUNTS": str(counts)},
            stdout=subprocess.DEVNULL,
            stderr=output,
        )
    return process, counts, log


def _finish(job: _Job, folder: Path) -> Counts:
    process, file, log = job
    if process.wait() != 0:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
        # libFuzzer's progress begins with #, and has names of the log categories in it
        told = _essence([line for line in lines if not line.startswith("#")])
        raise FindingError("\n".join(told), sorted(folder.glob("finding-*")))
    words = map(str.split, file.read_text(encoding="utf-8").splitlines() if file.exists() else ())
    return Counts({(name, bool(n)): int(count) for name, *both in words for n, count in enumerate(both)})


def _essence(lines: Sequence[str]) -> Iterator[str]:
    """Of a log of libFuzzer what was found and where in our C, without how it went there."""
    for line in lines:
        if line.startswith("    #"):
            _, _, place = line.partition(" in ")
            if ".sources/" in place or "verification/fuzzing/c/" in place:
                function, _, path = place.partition(" ")
                yield f"    {function} {Path(path).name}"
        elif any(word in line for word in ("broken property", "ERROR:", "runtime error", "SUMMARY")):
            yield line
