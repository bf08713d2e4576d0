"""Examples of what users build with the FMU."""
