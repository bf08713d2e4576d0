"""Connections to ArduPilot, MuJoCo, Gazebo, CasADi, JAX, Gymnasium, MCAP and thruster managers."""
