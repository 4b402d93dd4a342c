"""`python -m onboard` is the command `onboard`."""

from onboard.tools.cli import main

if __name__ == "__main__":
    main()
