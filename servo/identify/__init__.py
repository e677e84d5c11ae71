"""From the log of a robot to the settings that simulate it: read, estimate, write."""
