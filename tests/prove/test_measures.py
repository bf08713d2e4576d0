"""What is measured of an FMU, from answers that are made up: the numbers, the words and the verdicts."""

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fmpy.model_description import ScalarVariable

from rov_fmu.fmus.instance import RunError
from rov_fmu.interface.prove_command import conservation
from rov_fmu.io.csv_table import Series
from rov_fmu.prove import measures
from rov_fmu.prove.experiments import Experiment
from rov_fmu.prove.proof import ProofFinding
from rov_fmu.prove.runs import PlannedRun, Reaction
from rov_fmu.prove.subject import Subject

_VARIABLES = {"X_ext": "input", "u": "output", "der(u)": "local", **dict.fromkeys(("a_d_u", "F_0_u"), "parameter")}
_HELD = Series(time=array("d", (0.0, 1.0, 1.0)), X_ext=array("d", (1.0, 1.0, -1.0)))
_TWO_PIECES = Experiment("held", 0.0, 2.0, 0.1, 1e-3, {"k": "2"}, _HELD, None)


def subject(call: Callable[..., Any], *experiments: Experiment, **given: Any) -> Subject:
    """Return an FMU whose process answers by `call`, with a body of one axis; `given` is of its description."""

    class MadeUp(Subject):
        @contextmanager
        def runs(self, *_: Any, **__: Any) -> Iterator[Any]:
            yield SimpleNamespace(call=call)

    bounds = given.pop("bounds", {"a_d_u": {"min": "0.5"}, "F_0_u": {"max": "4"}})
    variables = [
        ScalarVariable(name, n, "Real", causality=causality, start="0", nominal="-2", **bounds.get(name, {}))
        for n, (name, causality) in enumerate(_VARIABLES.items())
    ]
    times = {"startTime": "0", "stopTime": "4", "stepSize": "0.5", "tolerance": "1e-4"}
    description: dict[str, Any] = {
        "fmiVersion": "2.0",
        "coSimulation": SimpleNamespace(canHandleVariableCommunicationStepSize=True),
        "modelVariables": variables,
        "defaultExperiment": SimpleNamespace(**times),
        "generationTool": "rov-fmu 1",
    }
    return MadeUp(Path("a.fmu"), "", SimpleNamespace(**description | given), [*experiments], None, None, 60.0)


def _unasked(*_: Any) -> Any:
    raise AssertionError("nothing is run")


# ---- What is run -----------------------------------------------------------------------------------------------------


def test_the_experiment_with_the_most_held_inputs_is_run() -> None:
    ramp = replace(
        _TWO_PIECES, name="ramp", stimuli=Series({name: array("d", (0.0, 1.0)) for name in ("time", "X_ext", "u")})
    )
    still = replace(_TWO_PIECES, name="still", stimuli=None)
    found = subject(_unasked, still, ramp, _TWO_PIECES)
    assert found.plan == PlannedRun(0.0, ((1.0, {"X_ext": 1.0}), (2.0, {"X_ext": -1.0})), {"k": "2"}, ["u"])
    assert (found.allowed, found.words) == (1e-3, "the experiment held (2 s)")
    two = Series(time=array("d", (0.0, 1.0, 1.0)), X_ext=array("d", (0.0, 0.0, 1.0)), u=array("d", (0.0, 0.0, 1.0)))
    more = replace(_TWO_PIECES, name="more", stimuli=two, stop=1.0)
    assert subject(_unasked, _TWO_PIECES, more, _TWO_PIECES).words == "the experiment more (1 s)"
    late = replace(_TWO_PIECES, start=0.5, stop=0.75)
    assert subject(_unasked, late).plan.pieces == ((0.75, {"X_ext": 1.0}),)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"fmiVersion": "1.0"}, "It is an FMU of FMI 1.0, and this is measured in FMI 2.0 and 3.0."),
        ({"coSimulation": None}, "It has no Co-Simulation."),
        ({"modelVariables": []}, "It has no output that is a number."),
    ],
)
def test_why_an_fmu_cannot_be_run_is_told(given: Mapping[str, Any], reason: str) -> None:
    for measure in (measures.step_size, measures.repeatability, measures.step_cost, conservation, measures.limits):
        found = measure(subject(_unasked, **given))
        assert (found.result, found.sentence) == ("does not apply", reason)


@pytest.mark.parametrize(("count", "off", "rows"), [(12, 1e-9, 12), (13, 1e-9, 0), (13, 2e-9, 13)])
def test_of_each_experiment_the_worst_variable_is_told(
    count: int, off: float, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    near = {"x": 2e-10, "y": 5e-10, "z": 1e-10}
    found = [ProofFinding(f"e{n}", name, near[name], 1e-9) for n in range(count) for name in near]
    found[1] = replace(found[1], deviation=off)
    monkeypatch.setattr(measures, "compare", lambda _: found)
    evidence = measures.expected(subject(_unasked, _TWO_PIECES))
    is_wrong = off > 1e-9
    words = f"{len(found) - is_wrong} of {len(found)} results of {count} experiments are as expected, within 1e-09 of "
    words += "the largest value of each variable."
    assert evidence.sentence == words + " Experiment e0: y deviates by 2.0e-09." * is_wrong
    assert (evidence.result, evidence.figure) == ("fails" if is_wrong else "holds", f"{off:.1e}")
    assert [*evidence.rows] == [(f"e{n}", "y", f"{5e-10 if n else off:.1e}", "1e-09") for n in range(rows)]
    assert evidence.curve == {"deviations": [off, *[5e-10] * (count - 1)], "tolerance": [1e-9] * count}


# ---- Runs ------------------------------------------------------------------------------------------------------------


def _ends(off: Mapping[int, float], end: float = 2.0) -> Callable[..., Any]:
    """Return answers to runs that end at a value, or off it by the number of steps; a run that is not there fails."""

    def call(_: str, plan: PlannedRun, steps: int) -> Any:
        if steps not in off:
            raise RunError("the FMU says no")
        values = np.full((len(plan.pieces) * steps + 1, 1), 99.0)  # the values inside a piece do not count
        values[steps::steps, 0] = [0.5 * end] * (len(plan.pieces) - 1) + [end + off[steps]]
        return values

    return call


_SAME = dict.fromkeys((1, 2, 5, 10, 50), 0.0)


def test_other_steps_end_where_one_step_ends() -> None:
    found = measures.step_size(subject(_ends(_SAME | {10: -1e-3}), _TWO_PIECES))
    assert (found.result, found.figure) == ("holds", "5.0e-04")
    assert found.sentence == (
        "The experiment held (2 s): 2, 5, 10 and 50 communication steps in each of the 2 pieces with held inputs end "
        "where one step ends, within 5.0e-04 of the largest value; 1e-03 is allowed."
    )
    assert {key: [*values] for key, values in found.curve.items()} == {
        "steps": [2, 5, 10, 50],
        "deviations": [0.0, 0.0, pytest.approx(5e-4), 0.0],
        "allowed": [1e-3],
    }


@pytest.mark.parametrize(
    ("off", "end", "result", "words"),
    [
        (_SAME | {50: 3e-4}, 2.0, "fails", "within 1.5e-04 of the largest value; 1e-04 is allowed."),
        (_SAME | {2: 9e-7}, 0.0, "holds", "within 4.5e-05 of the largest value"),  # 1 % of the nominal value is more
        (_SAME | {2: nan}, 2.0, "fails", "within inf of"),
        (
            dict.fromkeys(_SAME, nan),
            2.0,
            "holds",
            "communication steps in the run end where one step ends, within 0",
        ),
        ({2: 0.0, 5: 0.0}, 2.0, "holds", "is allowed. It refuses 50 in each piece: the FMU says no."),
        ({2: 0.0, 5: 0.0}, 2.0, "holds", "5 communication steps in the run end where 2 steps end"),
        ({1: 0.0}, 2.0, "does not apply", "several sizes. It refuses 50 in each piece: the FMU says no."),
    ],
)
def test_steps_that_end_elsewhere_or_are_refused_are_told(
    off: Mapping[int, float], end: float, result: str, words: str
) -> None:
    found = measures.step_size(subject(_ends(off, end)))
    assert found.result == result
    assert words in found.sentence


@pytest.mark.parametrize("other", [0, 3])
def test_runs_with_other_bits_are_counted(other: int) -> None:
    asked: list[int] = []

    def call(_: str, __: PlannedRun, steps: int) -> Any:
        asked.append(steps)
        return np.full((11, 1), 2.004 if len(asked) in range(50, 50 + other) else 2.0)

    found = measures.repeatability(subject(call))
    assert asked == [10] * 100
    assert (found.result, found.figure) == ("fails" if other else "holds", f"{100 - other} of 100")
    words = f"{100 - other} of 100 runs of the default experiment (4 s) in 2 processes, with 11 numbers each, have the "
    words += f"bits of the first one.{' The others deviate by up to 2.0e-03.' * bool(other)}"
    assert found.sentence == words


def test_the_cost_of_a_step_is_its_median_with_most_of_the_steps() -> None:
    def call(method: str, plan: PlannedRun, steps: int, most: float) -> list[float]:
        assert (method, plan.stop, steps, most) == ("durations", 4.5, 9, 1.0)
        return [*(1e-5 * n for n in range(1, 21)), 1.0]

    found = measures.step_cost(subject(call, defaultExperiment=SimpleNamespace(stopTime="4.5", stepSize="0.5")))
    assert (found.result, found.figure) == ("measured", "110 µs")
    assert found.sentence == (
        "The median of 21 communication steps of 0.5 s is 110 µs; 90 % take 20 µs to 200 µs, with the call from "
        "Python. That is 4,500 times as fast as real time."
    )
    assert [*found.curve["edges"]] == pytest.approx([5.5 * n for n in range(41)])  # µs
    assert [bool(share) for share in found.curve["shares"]].count(True) == 21
    assert (sum(found.curve["shares"]), found.curve["shares"][-1]) == pytest.approx((1.0, 1.0 / 21.0))
    for seconds, words in ((9.99e-4, "999 µs"), (1e-3, "1 ms"), (0.999, "999 ms"), (1.0, "1 s")):
        assert measures.step_cost(subject(lambda *_, seconds=seconds: [seconds])).figure == words


# ---- Energy ----------------------------------------------------------------------------------------------------------


def _body(free: float, *braked: float) -> Callable[..., Any]:
    """Return the answers of a body of 2 kg: the energy at the end of a glide without drag, and all those with drag."""

    def call(_: str, plan: PlannedRun, __: int) -> Any:
        if [*plan.outputs] == ["der(u)"]:
            return np.full((2, 1), 0.5 * plan.pieces[0][1]["X_ext"] + 0.1)
        assert (plan.stop, plan.parameters["u"], plan.parameters["F_0_u"]) == (10.0, "0.5", "0")
        return np.sqrt([[energy] for energy in ((1.0, free) if "a_d_u" in plan.parameters else (1.0, *braked))])

    return call


@pytest.mark.parametrize(
    ("energies", "result", "words"),
    [
        ((1.00005, 0.5, 0.25), "holds", "and never rises"),
        ((1.00005, 0.5, 0.25, 0.25 * (1.0 + 1e-13)), "holds", "and never rises"),  # by no more than rounding
        ((1.00005, 0.5, 0.25, 0.25 + 1e-11), "fails", "but rises by 1.0e-11 in a step."),
        ((1.0002, 0.5, 0.25), "fails", "within 2.0e-04; 1e-04 is allowed."),
        ((0.9998, 0.5, 0.25), "fails", "within 2.0e-04; 1e-04 is allowed."),
        (
            (1.00005, 0.2, 0.25),
            "fails",
            "it falls from 1 J to 0.25 J, but rises by 5.0e-02 in a step.",
        ),
    ],
)
def test_energy_is_neither_lost_without_drag_nor_gained_with_it(
    energies: Sequence[float], result: str, words: str
) -> None:
    found = conservation(subject(_body(*energies)))
    assert found.result == result
    assert words in found.sentence
    if result == "holds":
        assert found.figure == "5.0e-05"
        assert found.sentence == (
            "Without thrust, drag and constant loads, the kinetic energy stays the same for 10 s within 5.0e-05; 1e-04 "
            "is allowed. With its own drag it falls from 1 J to 0.25 J and never rises."
        )


def test_energy_is_not_measured_where_drag_cannot_be_switched_off() -> None:
    fixed = [copy(one) for one in subject(_unasked).description.modelVariables]
    fixed[-2].causality = "local"
    for given, reason in (
        ({"modelVariables": fixed}, "A_d_u cannot be set to 0."),
        (
            {"generationTool": "Other 1"},
            "It is known only of vehicles of rov-fmu which parameters",
        ),
        ({"modelVariables": fixed[:2]}, "It is known only of vehicles of rov-fmu"),
    ):
        found = conservation(subject(_unasked, **given))
        assert found.result == "does not apply"
        assert found.sentence.startswith(reason)


# ---- Limits ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tool", "refused", "kept", "result", "words"),
    [
        (
            "rov-fmu 1",
            1,
            1,
            "holds",
            "8 of 8 kinds of impossible values and steps are refused, and the old values",
        ),
        (
            "rov-fmu 1",
            0,
            0,
            "fails",
            "7 of 8 kinds of impossible values and steps are refused. Not refused: a step",
        ),
        ("rov-fmu 1", 1, 0, "fails", "are refused. A refusal changes something: a step of 0 s."),
        ("other", 0, 0, "measured", "a step of 0 s. FMI leaves that to the FMU, so it is told, and is no failure."),
        ("other", 1, 0, "fails", "8 of 8 kinds of impossible values and steps are refused. A refusal changes"),
    ],
)
def test_what_is_impossible_is_asked_of_an_fmu(tool: str, refused: int, kept: int, result: str, words: str) -> None:
    asked: list[tuple[str, Any]] = []

    def call(method: str, _: PlannedRun, argument: Any) -> Reaction:
        asked.append((method, argument))
        tried = len(argument) if method == "values_tried" else 1
        return Reaction(tried, tried, tried, "no") if argument != 0.0 else Reaction(1, refused, kept, "well")

    found = measures.limits(subject(call, generationTool=tool))
    assert repr(asked) == repr(
        [
            ("values_tried", [("X_ext", nan)]),
            ("values_tried", [("X_ext", inf)]),
            ("values_tried", [("a_d_u", nan), ("F_0_u", nan)]),
            ("values_tried", [("a_d_u", -0.5), ("F_0_u", 8.0)]),
            *(("step_tried", length) for length in (0.0, -0.5, 8.0, nan)),
        ]
    )
    assert found.result == result
    assert words in found.sentence
    assert [*found.rows][3:5] == [
        ("A parameter beyond its bounds", "2 of 2", "no"),
        ("A step of 0 s", f"{refused} of 1", "well"),
    ]


def test_a_number_without_bounds_has_none_beyond_them() -> None:
    def call(method: str, _: PlannedRun, argument: Any) -> Reaction:
        if method == "step_tried":
            raise RunError("cannot be run")
        return Reaction(len(argument), len(argument), len(argument), "no")

    found = measures.limits(subject(call, bounds={"F_0_u": {"declaredType": SimpleNamespace(min="-3")}}))
    assert (found.rows[3][1], found.rows[4]) == ("1 of 1", ("A step of 0 s", "0 of 1", "it cannot be run"))
    assert found.figure == "4 of 8"
