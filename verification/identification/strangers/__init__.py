"""The gate of strangers, python -m verification.identification.strangers: is a verdict right about any vehicle?

Half of the vehicles break the equation of the product, and the others obey it. water.py, kinds.py, drawn.py and fit.py
make them, and import nothing of the product. judge.py runs `identify` and compares it with the truth.
"""
