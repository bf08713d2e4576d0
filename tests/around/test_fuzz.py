"""The fuzzer's corpus finds nothing in the FMU's C, and finds what is planted there. The long run is python -m fuzz."""

import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import pytest

from checks.c_programs import clang
from checks.legal import MODES, legal_modes
from fuzz import __main__ as command
from fuzz.campaign import FindingError, build_target, fuzz, replay, unpack_corpus
from rov_fmu.export.archive import native_content
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

pytestmark = pytest.mark.skipif(clang() is None, reason="clang with its sanitizers is not installed")


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    unpack_corpus(tmp_path / "corpus")
    return tmp_path / "corpus"


@pytest.mark.parametrize(
    "name", [n if n == "videoray" else pytest.param(n, marks=pytest.mark.long) for n in command.VEHICLES]
)
def test_the_corpus_reaches_every_function_and_finds_nothing(corpus: Path, tmp_path: Path, name: str) -> None:
    build_target(native_content(load_vehicle(command.VEHICLES[name])).sources, tmp_path / "target")
    counts = replay(tmp_path / "target", [corpus], tmp_path)
    legal = {name for kind in MODES for name in legal_modes(kind)}
    never = {"fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"}  # no step is ever pending
    assert {name for name, accepted in +counts if accepted} == legal - never
    assert {name for name, accepted in +counts if not accepted} == legal | {"fmi2CancelStep"}


# A line of C, what it is made into, and how the fuzzer tells.
PLANTED = {
    "a bound is not looked at": (
        "fmi2_common.c",
        "if (value[i] < info->minimum || value[i] > info->maximum) {",
        "if (value[i] < info->minimum) {",
        "fmi2SetReal: illegal",
    ),
    "a refused value stays": (
        "fmi2_common.c",
        "        if (!isfinite(value[i])) {",
        "        f->now.values[vr[i]] = isfinite(value[i]) ? value[i] : old;\n        if (!isfinite(value[i])) {",
        "fmi2SetReal changes instance",
    ),
    "a value reference is not looked at": (
        "fmi2_common.c",
        'REQUIRE("fmi2GetReal", vr[i] < N_VARIABLES,',
        'REQUIRE("fmi2GetReal", vr[i] < N_VARIABLES + 2,',
        "runtime error: index 4[67] out of bounds",
    ),
    "a call is legal in a mode too many": (
        "fmi2_model_exchange.c",
        'OPEN("fmi2SetContinuousStates", CONTINUOUS);',
        'OPEN("fmi2SetContinuousStates", CONTINUOUS | EVENT);',
        "fmi2SetContinuousStates: illegal in Event Mode",
    ),
    "a message may introduce a value reference": (
        "fmi2_instance.h",
        "if (*c == '%' || *c == '#') {",
        "if (*c == '%') {",
        "a message with a single #",
    ),
    "what is warned of once is in the state": (
        "fmi2_common.c",
        "    if (f->now.mode == INSTANTIATED) {\n        WARN",
        "    if (f->now.mode == INSTANTIATED) {\n        f->now.time = 1.0;\n        WARN",
        "to read changes the instance",
    ),
    "the last byte of a state is not there": (
        "fmi2_state.c",
        "size >= SERIALIZED_SIZE,",
        "size >= SERIALIZED_SIZE - 1,",
        "AddressSanitizer: heap-buffer-overflow",
    ),
    "the time is not in the bytes": (
        "fmi2_state.c",
        "put_double(&to, s->time);",
        "put_double(&to, 0.0);",
        "a state restored from bytes goes another way",
    ),
    "damaged bytes are taken": (
        "fmi2_state.c",
        "get_word(&from) == checksum(bytes, SERIALIZED_SIZE - 8),",
        "get_word(&from) + 1 > 0,",
        "fmi2DeSerializeFMUstate: illegal",
    ),
    "a restored state steps with the coefficients from before": (
        "fmi2_state.c",
        "    rov_prepare(f->now.values, &f->gains);\n",
        "",
        "the gains are those of other coefficients|goes another way",
    ),
    "a state is not freed": ("fmi2_state.c", "    free(saved);\n", "", "LeakSanitizer: detected memory leaks"),
    "overflow is not looked at": ("fmi2_co_simulation.c", "if (sum != 0.0) {", "if (sum > 0.0) {", "broken property"),
    "fast motion is pushed by its drag": (
        "riccati.c",
        "const double change = (c - (b + drag) * v0) * N / growth;",
        "const double change = (c - (3.0 * b - drag) * v0) * N / growth;",
        "without force|beyond its equilibrium|at no more than",
    ),
    "a thrust turns the vehicle past its steady rate": (
        "riccati.c",
        "growth = M + drag * N;",
        "growth = M + drag * N * 0.999;",
        "beyond its equilibrium",
    ),
    "a dive goes further than its fastest": (
        "rov_step.c",
        "    rov_pose(rov_value(state, POSE_psi), way,",
        "    way[HEAVE] *= 1.000001;\n    rov_pose(rov_value(state, POSE_psi), way,",
        "broken property .*: z goes from",
    ),
    "a turn makes the way longer": (
        "rov_step.c",
        "way[U] = sum.ahead;",
        "way[U] = 1.000001 * sum.ahead;",
        "at no more than",
    ),
}


PLANTED_IN_HEAVY = {
    "the coupling does a lot of work": (
        "rov.c",
        "rate[V] -= gains->c_v * v[U] * v[R];",
        "rate[V] += 100.0 * gains->c_v * v[U] * v[R];",
        "at most",
    ),
    "a lag overshoots": (
        "rov_step.c",
        "(held.F[t] - held.steady[t]) * expm1(",
        "1.01 * (held.F[t] - held.steady[t]) * expm1(",
        "F of thruster",
    ),
}


@pytest.mark.long
def test_a_finding_can_be_made_again(
    vehicle: Vehicle, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From the file that is kept, or from what is printed of it."""
    file, line, planted, told = PLANTED["the time is not in the bytes"]
    content = native_content(vehicle)
    content = replace(content, sources={**content.sources, file: content.sources[file].replace(line, planted)})
    monkeypatch.setattr(command, "native_content", lambda _vehicle: content)
    monkeypatch.chdir(tmp_path)
    assert command.main(["--vehicle", "videoray", str(corpus)]) == 1
    assert told in (words := capsys.readouterr().err)
    (kept,) = tmp_path.glob("finding-*")
    assert f"again with: python -m fuzz --vehicle videoray ./{kept.name}, in base64:\n" in words
    assert b64decode(words.split()[-1]) == kept.read_bytes()
    assert command.main(["--vehicle", "videoray", kept.name]) == 1
    assert told in capsys.readouterr().err


def test_every_defect_has_a_place_to_be_planted(vehicle: Vehicle) -> None:
    sources, planted = native_content(vehicle).sources, PLANTED | PLANTED_IN_HEAVY
    assert [name for name, (file, line, *_) in planted.items() if sources[file].count(line) != 1] == []


@pytest.mark.long
@pytest.mark.parametrize("name", [*PLANTED, *PLANTED_IN_HEAVY])
def test_a_planted_defect_is_found_within_a_minute(corpus: Path, tmp_path: Path, name: str) -> None:
    file, line, planted, told = (PLANTED | PLANTED_IN_HEAVY)[name]
    vehicle = load_vehicle(command.VEHICLES["videoray" if name in PLANTED else "bluerov2_heavy"])
    sources = dict(native_content(vehicle).sources)
    sources[file] = sources[file].replace(line, planted)
    build_target(sources, tmp_path / "target")
    with pytest.raises(FindingError) as found:
        fuzz(tmp_path / "target", corpus, tmp_path, seconds=60, jobs=2)
    assert re.search(told, str(found.value))
    assert found.value.inputs
