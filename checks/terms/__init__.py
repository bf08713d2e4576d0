"""The motion of a vehicle by a table of terms and one method: an implementation beside that of the FMU."""
