"""What a user would build with the FMU."""
