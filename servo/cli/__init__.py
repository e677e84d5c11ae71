"""The command line: one file a command. Everything that prints is here."""
