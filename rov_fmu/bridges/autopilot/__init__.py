"""The autopilot for other tools: its FMU, and its gains as a file."""
