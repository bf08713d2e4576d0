"""The fuzzer's corpus finds nothing in the FMU's C, and it finds planted defects."""

import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import pytest

from rov_fmu.fmu.archive import native_content
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.fuzzing import __main__ as command
from verification.fuzzing.campaign import FindingError, build_target, fuzz, replay, unpack_corpus
from verification.references.c_programs import clang
from verification.references.legal import legal_modes

pytestmark = pytest.mark.skipif(clang() is None, reason="clang with its sanitizers is not installed")


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    unpack_corpus(tmp_path / "corpus")
    return tmp_path / "corpus"


NEVER = {2: {"fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"}, 3: set[str]()}
"""The legal calls that are refused, because no step is ever pending."""
MISSING = {
    2: {"fmi2CancelStep"},
    3: {
        "fmi3EnterConfigurationMode",
        "fmi3ExitConfigurationMode",
        "fmi3ActivateModelPartition",
        "fmi3GetNumberOfVariableDependencies",
        "fmi3GetVariableDependencies",
    },
}


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_corpus_reaches_every_function(tmp_path: Path, corpus: Path, fmi: int) -> None:
    """And finds nothing. `python -m verification.fuzzing` begins with the corpus, for every vehicle."""
    build_target(native_content(load_vehicle(command.VEHICLES["videoray"]), fmi=fmi).sources, tmp_path / "target", fmi)
    counts = replay(tmp_path / "target", [corpus], tmp_path)
    # FMI 3.0 has one more kind of instances.
    legal = {name for kind in range(fmi) for name in legal_modes(kind, fmi)}
    assert {name for name, accepted in +counts if accepted} == legal - NEVER[fmi]
    assert {name for name, accepted in +counts if not accepted} == legal | MISSING[fmi]


# A line of C, its defective replacement, and the report of the fuzzer.
PLANTED = {
    "a bound is not looked at": (
        "instance.c",
        "if (value[i] < info->minimum || value[i] > info->maximum) {\n                DISCARD",
        "if (value[i] < info->minimum) {\n                DISCARD",
        "SetReal: illegal",
    ),
    "a refused value stays": (
        "instance.c",
        "        if (!isfinite(value[i])) {",
        "        f->now.values[place] = isfinite(value[i]) ? value[i] : old;\n        if (!isfinite(value[i])) {",
        "SetReal changes instance",
    ),
    "a value reference is not looked at": (
        "instance.c",
        "return place < N_VARIABLES ? &f->now.values[place]",
        "return place < N_VARIABLES + 2 ? &f->now.values[place]",
        "heap-buffer-overflow|GetReal: illegal",
    ),
    "a call is legal in a mode too many": (
        "instance.h",
        "MAY_INTEGRATE = CONTINUOUS,",
        "MAY_INTEGRATE = CONTINUOUS | EVENT,",
        "(SetContinuousStates|CompletedIntegratorStep): illegal in Event Mode",
    ),
    "a message may introduce a value reference": (
        "instance.h",
        "if (*c == '#' || (LOG_IS_FORMAT && *c == '%')) {",
        "if (LOG_IS_FORMAT && *c == '%') {",
        "a message with a single #",
    ),
    "what is warned of once is in the state": (
        "instance.c",
        "    warn_in(f, INSTANTIATED, READ_EARLY);",
        "    f->now.time = 1.0;\n    warn_in(f, INSTANTIATED, READ_EARLY);",
        "to read changes the instance",
    ),
    "the last byte of a state is not there": (
        "saved.c",
        "size >= SERIALIZED_SIZE,",
        "size >= SERIALIZED_SIZE - 1,",
        "AddressSanitizer: heap-buffer-overflow",
    ),
    "the time is not in the bytes": (
        "saved.c",
        "put_double(&to, s->time);",
        "put_double(&to, 0.0);",
        "a state restored from bytes goes another way",
    ),
    "damaged bytes are taken": (
        "saved.c",
        "get_word(&from) == checksum(bytes, SERIALIZED_SIZE - 8),",
        "get_word(&from) + 1 > 0,",
        "fmi2DeSerializeFMUstate: illegal",
    ),
    "a restored state steps with the coefficients from before": (
        "saved.c",
        "    model_prepare(f->now.values, &f->numbers);\n",
        "",
        "the numbers are those of other coefficients|goes another way",
    ),
    "a state is not freed": ("saved.c", "    free(saved);\n", "", "LeakSanitizer: detected memory leaks"),
    "overflow is not looked at": (
        "instance.c",
        "if (!all_finite(next, N_STATES)) {",
        "if (!all_finite(next, 0)) {",
        "broken property",
    ),
    "a failed step moves the time": (
        "instance.c",
        "    TRY(check_step(f, t, h));\n    TRY(advance",
        "    TRY(check_step(f, t, h));\n    f->now.time = t;\n    TRY(advance",
        "fmi2DoStep changes instance",
    ),
    "a rate of an output is not that of the motion": (
        "instance.c",
        "value[i] = rates[place_of(vr[i])];",
        "value[i] = 1.000001 * rates[place_of(vr[i])];",
        "der\\(",
    ),
    "drag pushes a motion": (
        "step.c",
        "        s->c[1][i] = unit * rate[i];",
        "        s->c[1][i] = 1.0001 * unit * rate[i];",
        "beyond its equilibrium|a step and its parts|at no more than",
    ),
    "a long step stops at low order": (
        "series.c",
        "done &= a + 0.01 * b <= before * size + DBL_MIN;",
        "done &= a + 0.01 * b <= 1e9 * before * size + DBL_MIN;",
        "beyond its equilibrium|a step and its parts|at no more than|without force",
    ),
    "a reversal is not seen": (
        "series.c",
        "keeps &= (against ? fabs(c0) - fabs(c1) : fabs(c0) + fabs(c1)) >= others[i];",
        "keeps &= fabs(c0) + fabs(c1) >= others[i];",
        "without force|beyond its equilibrium|a step and its parts|at no more than",
    ),
    "a dive goes further than its fastest": (
        "step.c",
        "motion_add(&m->displacement[i], change[i], &m->lost[i]);",
        "motion_add(&m->displacement[i], 1.000001 * change[i], &m->lost[i]);",
        "goes from|at no more than",
    ),
}


PLANTED_IN_HEAVY = {
    "the coupling does a lot of work": (
        "equation.h",
        "n->coupling_v_ur = -",
        "n->coupling_v_ur = 100.0 * ",
        "at most|a step and its parts",
    ),
    "a quaternion grows": (
        "equation.h",
        "const real next_eta = row_0 / divisor;",
        "const real next_eta = 1.001 * row_0 / divisor;",
        "a quaternion of the length",
    ),
    "a turn is counted too much": (
        "instance.c",
        "    f->now.heading = heading;\n    return DONE;",
        "    f->now.heading = heading + 7.0;\n    return DONE;",
        "psi is .* beside|the heading jumps",
    ),
    "a lag overshoots": (
        "equation.h",
        "q->F_1 = q->F_1 + (q->steady_1 - q->F_1) * y",
        "q->F_1 = q->F_1 + 1.01 * (q->steady_1 - q->F_1) * y",
        "F_1|a step and its parts",
    ),
}


PLANTED_IN_FMI3 = {
    "the adjoint takes another row": (
        "fmi3_common.c",
        "sum += seed[i] * d[place_of(unknowns[i])];",
        "sum += seed[i] * d[place_of(unknowns[n_unknowns - 1])];",
        "adjoint .*, directional",
    ),
    "the number of values is not looked at": (
        "fmi3_common.c",
        "REQUIRE(references == values,",
        "REQUIRE(references <= values + 1,",
        "illegal|heap-buffer-overflow",
    ),
    "an update may save the state": (
        "instance.h",
        "MAY_SAVE = BETWEEN,",
        "MAY_SAVE = BETWEEN | INTERMEDIATE,",
        "illegal in Intermediate Update Mode",
    ),
    "an update may tune": (
        "instance.c",
        "case INTERMEDIATE: return kind == INPUT &&",
        "case INTERMEDIATE: return kind == TUNABLE || kind == INPUT &&",
        "fmi3SetFloat64: illegal in Intermediate Update Mode",
    ),
    "pieces are counted from the time": (
        "fmi3_co_simulation.c",
        "TRY(advance(f, t + from, gone - from, &cuts));",
        "TRY(advance(f, t + from, t + gone - (t + from), &cuts));",
        "a step and its parts|broken property",
    ),
    "an early return goes on": (
        "fmi3_co_simulation.c",
        "*length = fmax(wanted - t, gone);",
        "*length = fmax(wanted - t, gone) + 1e-4;",
        "an early return|what an update may|update .* instead of|a step from",
    ),
    "inputs are taken at the end of a piece": (
        "fmi3_co_simulation.c",
        "        TRY(advance(f, t + from, gone - from, &cuts));\n",
        "        TRY(advance(f, t + from, 1.001 * (gone - from), &cuts));\n",
        "broken property",
    ),
    "Event Mode without its being asked for": (
        "fmi3_common.c",
        "if (f->now.mode == STEP && !f->host.uses_events) {",
        "if (f->now.mode == STEP && f->host.uses_events && !f->host.uses_events) {",
        "fmi3EnterEventMode: illegal in Step Mode",
    ),
    "a state in Event Mode is put where there is none": (
        "saved.c",
        "(has_event_mode(&f->host) ? EVENT : 0)",
        "(f != NULL ? EVENT : 0)",
        "(fmi3SetFMUState|fmi3DeserializeFMUState): illegal|in Event Mode instead",
    ),
}
EVERY_PLANTED = {
    **{name: ("videoray", 2, *planted) for name, planted in PLANTED.items()},
    **{name: ("bluerov2_heavy", 2, *planted) for name, planted in PLANTED_IN_HEAVY.items()},
    **{name: ("videoray", 3, *planted) for name, planted in PLANTED_IN_FMI3.items()},
}


@pytest.mark.long
def test_a_finding_can_be_made_again(
    vehicle: Vehicle, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From the file that is kept, or from what is printed of it."""
    file, line, planted, told = PLANTED["the time is not in the bytes"]
    content = native_content(vehicle)
    content = replace(content, sources={**content.sources, file: content.sources[file].replace(line, planted)})
    monkeypatch.setattr(command, "native_content", lambda *_, **__: content)
    monkeypatch.chdir(tmp_path)
    assert command.main(["--vehicle", "videoray", "--fmi", "2", str(corpus)]) == 1
    assert told in (words := capsys.readouterr().err)
    (kept,) = tmp_path.glob("finding-*")
    assert f"again with: python -m verification.fuzzing --vehicle videoray --fmi 2 ./{kept.name}, in base64:\n" in words
    assert b64decode(words.split()[-1]) == kept.read_bytes()
    assert command.main(["--vehicle", "videoray", "--fmi", "2", kept.name]) == 1
    assert told in capsys.readouterr().err


def test_every_defect_has_a_place_to_be_planted() -> None:
    sources = {
        (name, fmi): native_content(load_vehicle(command.VEHICLES[name]), fmi=fmi).sources
        for name, fmi, *_ in EVERY_PLANTED.values()
    }
    every = EVERY_PLANTED.items()
    assert [name for name, (of, fmi, file, line, *_) in every if sources[of, fmi][file].count(line) != 1] == []


# Two defects of each vehicle and version of FMI; the weekly tests have all of them.
_SOME = {name for planted in (PLANTED, PLANTED_IN_FMI3) for name in (min(planted), max(planted))}
_SOME.add("a quaternion grows")  # the other defects of the six-axis vehicle take minutes to be found


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.long if n in _SOME else pytest.mark.weekly) for n in EVERY_PLANTED],
)
def test_a_planted_defect_is_found_within_a_minute(corpus: Path, tmp_path: Path, name: str) -> None:
    vehicle, fmi, file, line, planted, told = EVERY_PLANTED[name]
    sources = dict(native_content(load_vehicle(command.VEHICLES[vehicle]), fmi=fmi).sources)
    sources[file] = sources[file].replace(line, planted)
    build_target(sources, tmp_path / "target", fmi)
    with pytest.raises(FindingError) as found:
        fuzz(tmp_path / "target", corpus, tmp_path, seconds=60, jobs=2)
    assert re.search(told, str(found.value))
    assert found.value.inputs
