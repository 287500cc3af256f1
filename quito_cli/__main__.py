"""`python -m quito_cli` is `quito`."""

from quito_cli.cli.app import main

if __name__ == "__main__":
    main()
