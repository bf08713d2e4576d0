"""What logs contain, and what no fit can learn from them."""
