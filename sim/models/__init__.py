"""MuJoCo models of rooms, robots and targets, from files to one compiled scene."""
