"""The evidence in an FMU: what it was made from, how far its numbers are known, and hashes that show a change."""
