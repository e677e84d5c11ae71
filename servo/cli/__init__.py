"""The command line `servobench`: one module for each command, and the options, printing and
handling of signals that commands share.
"""
