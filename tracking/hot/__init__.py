"""The compiled loops, and nothing else: each has a plain NumPy twin in tests/test_hot*.py.

numba is used in this folder only. It compiles a loop when it is first called and keeps the result
on disk, so that only the first run on a machine waits for it.
"""
