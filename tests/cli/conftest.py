"""Builds in this process compile the same C once."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache

import pytest

from rov_fmu.c import compile as compilation


@cache
def _library(name: str, sources: tuple[tuple[str, str], ...], identifier: str, fmi: int) -> bytes:
    return compilation.compile_all([name], dict(sources), identifier, fmi=fmi)[name]


@cache
def _module(sources: tuple[tuple[str, str], ...]) -> bytes:
    return compilation.compile_module(dict(sources))


def _compile_all(
    platforms: Sequence[str], sources: Mapping[str, str], identifier: str, on_done: Callable[[str], None], fmi: int
) -> dict[str, bytes]:
    libraries = {}
    for name in platforms:
        libraries[name] = _library(name, tuple(sources.items()), identifier, fmi)
        on_done(name)
    return libraries


@pytest.fixture(scope="package", autouse=True)
def _compiled_once() -> Iterator[None]:
    """Let builds of the tests in this folder compile the same sources only once."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.build.compile_all", _compile_all)
        patched.setattr("rov_fmu.fmu.content.compile_module", lambda sources: _module(tuple(sources.items())))
        yield
