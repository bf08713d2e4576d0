"""Connections to ArduPilot, Gazebo, CasADi, JAX and Gymnasium."""
