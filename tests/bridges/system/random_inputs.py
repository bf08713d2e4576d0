"""Set any numbers as inputs of a companion and step it: python -m tests.bridges.system.random_inputs NAME SEED."""

import random
import sys

from rov_fmu.bridges.system.companion import slave_of

ANY = (0.0, -1.0, 1.0, 30.0, 1e3, -1e3, 1e9, -1e9, 1e150, -1e300, 1.7e308, 5e-324)


def step_at_random(name: str, seed: int, runs: int = 30) -> None:
    """Step a companion with any inputs. An exception in a step is what PythonFMU makes a message of."""
    draw = random.Random(seed)
    for _ in range(runs):
        slave = slave_of(name)(instance_name="one")
        slave.log = lambda *_: None
        inputs = [one for one, (causality, *_) in slave.variables.items() if causality == "input"]
        try:
            slave.exit_initialization_mode()
            for n in range(20):
                for one in draw.sample(inputs, draw.randint(0, len(inputs))):
                    setattr(slave, one, draw.choice(ANY) if draw.random() < 0.3 else draw.uniform(-5.0, 50.0))
                if not slave.do_step(0.02 * n, 0.02):
                    break
        except (ArithmeticError, ValueError):
            pass
        slave.terminate()


if __name__ == "__main__":
    step_at_random(sys.argv[1], int(sys.argv[2]))
    print("done")
