"""The VideoRay under depth hold and heading hold, in three co-simulation engines."""
