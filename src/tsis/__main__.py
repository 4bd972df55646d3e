"""``python -m tsis``: the command without its script."""

from tsis.cli import main

if __name__ == "__main__":
    main()
