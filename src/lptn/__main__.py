"""`python -m lptn`."""

from lptn.cli.main import main

if __name__ == "__main__":
    main()
