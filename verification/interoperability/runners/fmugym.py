"""FMUGym, Co-Simulation: the FMU as a Gymnasium environment with outputs in single precision."""

from typing import Any

import numpy as np
from fmugym import FMUGym, FMUGymConfig, VarSpace

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, fly, parameters, steps


class Rov(FMUGym):  # type: ignore[misc]
    """The environment."""

    def _noisy_init(self) -> dict[int, float]:
        reference = {variable.name: variable.valueReference for variable in self.fmu_description.modelVariables}
        return {reference[name]: value for name, value in parameters().items()}

    def compute_reward(self, *_: Any) -> float:
        return 0.0


def space(*names: str) -> VarSpace:
    """Return a space of variables without bounds."""
    variables = VarSpace("variables")
    for name in names:
        variables.add_var_box(name, -np.inf, np.inf)
    return variables


def advance(step: Step) -> None:
    rov.step(np.array([step.inputs[name] for name in rov.input_dict]))


rov = Rov(
    FMUGymConfig(
        FMU,
        stop_time=30.0,
        sim_step_size=0.1,
        action_step_size=0.1,
        inputs=space(*steps()[0].inputs),
        outputs=space(*OUTPUTS),
        random_vars=space(),
    )
)
rov.reset()
fly(advance, lambda: [float(rov.observation[name][0]) for name in OUTPUTS])
rov.close()
