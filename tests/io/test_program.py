"""What this program is called in what it makes."""

import shutil
from pathlib import Path

import pytest

from rov_fmu.io import program


@pytest.mark.parametrize(("number", "tells_code"), [("1.2.0", False), ("1.3.0.dev0", True)])
def test_a_version_in_development_tells_other_code_by_a_digest(
    number: str, tells_code: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = Path(shutil.copytree(Path(program.__file__).parent, tmp_path / "code"))
    monkeypatch.setattr(program, "_CODE", copy)
    monkeypatch.setattr(program, "__version__", number)
    first, again = (program.version.__wrapped__() for _ in range(2))
    (copy / "other.py").write_text("new")
    assert first == again
    assert first.startswith(number)
    assert (first != program.version.__wrapped__()) == tells_code == (first != number)
