"""The closed loop, its steps, and what is measured of them."""
