"""`python -m symgen`: the command `symgen`, for a shell that does not find it."""

from symgen.cli.main import main

if __name__ == "__main__":
    main()
