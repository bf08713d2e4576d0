"""The FMU in independent importers: python -m interop."""
