"""The trackers' compiled loops; tests/test_loops*.py compare each with its twin in NumPy.

Numba compiles a loop at its first call and stores the result on disk (`sim/compiled.py`), so that
only the first run on a machine takes longer.
"""
