"""Short example programs, one for each task; python -m servo.examples.own_tracker runs one."""
