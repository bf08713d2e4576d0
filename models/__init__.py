"""Vehicles and their mathematics; knows nothing of FMI."""
