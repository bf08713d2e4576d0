"""An autopilot for any vehicle that its thrusters can hold: its law in C, its gains, and flights."""
