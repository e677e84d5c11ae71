"""The command line `servobench`: one module for each command. Only this package prints on the
terminal.
"""
