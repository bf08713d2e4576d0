"""The data sets: one folder each of those that are published, and a module of the simulated ones."""

from pathlib import Path

from verification.identification.data import published

_HERE = Path(__file__).parent
EXJOBB, TAUV = published(_HERE / "exjobb"), published(_HERE / "tauv")
