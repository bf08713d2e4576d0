"""The methods, one module each. The list is METHODS in verification/identification/__main__.py."""
