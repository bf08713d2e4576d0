"""What is measured, with one command: python -m verification.benchmarks."""
