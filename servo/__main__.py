"""`python -m servo` is the command `servobench`."""

from servo.cli.main import main

if __name__ == "__main__":
    main()
