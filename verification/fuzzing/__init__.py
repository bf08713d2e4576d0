"""The C of the FMU under clang's sanitizers and its fuzzer: python -m verification.fuzzing."""
