"""Systems of FMUs, and connections to ArduPilot, MuJoCo, Gazebo, CasADi, JAX, Gymnasium and thruster managers."""
