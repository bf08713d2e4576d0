"""The FMU in independent importers: python -m verification.interoperability."""
