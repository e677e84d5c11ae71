"""Short programs that each show one thing: python -m servo.examples.own_tracker."""
