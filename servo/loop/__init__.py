"""Package of the closed loop: pictures in, camera twists out; the steps of a run, and the measures
computed from them.
"""
