"""The FMUs that tests of systems build are kept in a folder of each test."""

from pathlib import Path

import pytest

from rov_fmu.bridges.system import system


@pytest.fixture(autouse=True)
def fmus(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache folder, in which a stand-in for an FMU must not stay."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setattr(system, "user_cache_path", lambda *_, **__: folder)
    return folder
