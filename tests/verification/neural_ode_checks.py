"""The tests of every method, for the neural ODE: JAX starts threads, and other tests start processes by forks."""

import tempfile
from pathlib import Path

from tests.verification import test_identification as tests
from verification.identification.data import split_of
from verification.identification.datasets.simulated import TINY
from verification.identification.methods.neural_ode import NeuralODE
from verification.identification.protocol import run

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        split = split_of(TINY, None, Path(folder))
        outcome = run(NeuralODE(), split)
        tests.test_a_method_predicts_the_future_from_the_past_alone(outcome)
        tests.test_every_method_has_bands_around_a_finite_prediction(outcome)
        tests.test_models_beat_no_change_and_ours_is_near_the_noise(outcome, split)
        print("passed")
