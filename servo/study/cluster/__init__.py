"""Runs tasks in worker processes with Dask, on this machine or on an existing cluster. The import
of this package raises a `Mistake` if Dask's configuration files cannot be read.
"""

from importlib import import_module

from servo.mistake import Mistake

try:
    import_module("dask.config")  # reads the user's files, such as ~/.config/dask/tls.yaml
except ValueError as error:
    raise Mistake(f"Dask's settings cannot be read; correct them: {error}") from None
