"""The VideoRay with an autopilot, a current that varies and a battery, in three co-simulation engines."""
