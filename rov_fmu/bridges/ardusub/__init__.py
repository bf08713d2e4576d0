"""The gains of ArduSub for a vehicle, and the loops that they close."""
