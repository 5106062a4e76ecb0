"""``python -m mcsettle``: the command ``mcsettle``."""

from mcsettle.cli.app import main

if __name__ == "__main__":
    main()
