"""Parts for servobench from outside: a tracker, a target, a robot, a motion, features, a law."""
