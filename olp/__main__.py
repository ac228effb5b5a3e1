"""`python -m olp`."""

from olp.cli import main

if __name__ == "__main__":
    main(prog_name="olp")
