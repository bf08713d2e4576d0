"""An identified underwater vehicle (ROV) as an FMU: tank tests to vehicle file, vehicle file to FMU."""

__version__ = "0.2.0"
