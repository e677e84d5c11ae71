"""Work over processes with Dask: on this machine, or on a cluster that the user already has."""
