"""What logs and tables contain before a vehicle is known."""
