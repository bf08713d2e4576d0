"""The ROV identification benchmark, python -m verification.identification: how well methods predict unseen motion.

It has nothing to do with verification.benchmarks, which measures the speed of the FMU.
"""
