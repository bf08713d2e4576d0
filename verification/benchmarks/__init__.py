"""The benchmarks: python -m verification.benchmarks."""
