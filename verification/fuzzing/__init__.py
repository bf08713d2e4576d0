"""Fuzzing of the FMU's C with libFuzzer and clang's sanitizers, and of logs: python -m verification.fuzzing."""
