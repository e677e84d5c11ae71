"""All compiled loops; tests/test_loops*.py compare each with the same function in plain NumPy.

Only this folder uses numba, which compiles a loop at its first call and stores the result on disk,
so that only the first run on a machine takes longer.
"""
