"""The trackers' compiled loops; tests compare them with twins in NumPy.

Numba compiles a loop at its first call and stores the result on disk (`sim/compiled.py`), so that
only the first run on a machine takes longer.
"""
