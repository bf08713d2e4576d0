"""The data sets, one module each. The list is DATA_SETS in verification/identification/__main__.py."""
