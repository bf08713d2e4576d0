"""The tests. They use all cores already, so linear algebra gets one thread: NumPy reads this when it is imported."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
