"""Fuzzing of the FMU's C with libFuzzer and clang's sanitizers: python -m verification.fuzzing."""
