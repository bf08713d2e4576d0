"""What goes into the FMU and what puts it there."""
