"""`python -m profilefit` is the profilefit command."""

from profilefit.cli import main

main()
