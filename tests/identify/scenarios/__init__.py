"""Scenarios that identification is held to: which logs there are, what disturbs them, and what must come of them."""
