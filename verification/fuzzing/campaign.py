"""Build the fuzzer, run it on several processors, and keep its findings and its corpus."""

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
_LONGEST_TIME = 300
"""The longest time of one input, s. With the sanitizers, a few long steps take 20 s, and a minute on a busy machine."""


class FindingError(Exception):
    """A sanitizer's report or a broken property, with the inputs that cause it."""

    def __init__(self, message: str, inputs: Sequence[Path] = ()) -> None:
        super().__init__(message)
        self.inputs = inputs


Counts = Counter[tuple[str, bool]]
"""The number of calls by function and by whether they were accepted."""


def build_target(sources: Mapping[str, str], output: Path, fmi: int = 2) -> None:
    """Compile the fuzzer for the sources of an FMU, with AddressSanitizer and UndefinedBehaviorSanitizer."""
    content = {**sources, "legal.h": legal_header(fmi)}
    # With the loops of a step unrolled and instrumented, the compiler takes six times as long.
    # With the sanitizers, 100,000 pieces take longer than an input may.
    flags = ("-Dalways_inline=noinline", "-DMOST_PIECES=10000")
    compile_c(TARGET_SOURCE, output, content, *flags, sanitizers="fuzzer,address,undefined")


def unpack_corpus(folder: Path, every: int = 1) -> None:
    """Write every input of the corpus, or every n-th one, into a folder, one file each."""
    with zipfile.ZipFile(CORPUS) as kept:
        kept.extractall(folder, kept.namelist()[::every])


def pack_corpus(targets: Sequence[Path], folder: Path) -> int:
    """Pack the inputs of a folder that together reach the same places in all targets. Return their number."""
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
    """Run each input, given as a file or in a folder, once. Raises FindingError."""
    return _finish(_start(target, folder, ["-runs=0", *map(str, inputs)]), folder)


def fuzz(target: Path, corpus: Path, folder: Path, seconds: int, jobs: int) -> Counts:
    """Fuzz for some seconds in several processes that share a corpus. Raises FindingError."""
    arguments = [
        str(corpus),
        f"-max_total_time={seconds}",
        f"-max_len={_LONGEST_INPUT}",
        f"-timeout={_LONGEST_TIME}",
        f"-report_slow_units={_LONGEST_TIME}",  # a slow input that ends is no finding
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
        # Lines of libFuzzer's progress begin with #. They may contain names of log categories.
        message = _report([line for line in lines if not line.startswith("#")])
        raise FindingError("\n".join(message), sorted(folder.glob("finding-*")))
    words = map(str.split, file.read_text(encoding="utf-8").splitlines() if file.exists() else ())
    return Counts({(name, bool(n)): int(count) for name, *both in words for n, count in enumerate(both)})


def _report(lines: Sequence[str]) -> Iterator[str]:
    """Yield the lines of libFuzzer's log that name a finding, and its places in our C."""
    for line in lines:
        if line.startswith("    #"):
            _, _, place = line.partition(" in ")
            if ".sources/" in place or "verification/fuzzing/c/" in place:
                function, _, path = place.partition(" ")
                yield f"    {function} {Path(path).name}"
        elif any(word in line for word in ("broken property", "ERROR:", "runtime error", "SUMMARY")):
            yield line
