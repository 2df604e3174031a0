"""`python -m mcml_sim` is the mcml-sim command."""

from mcml_sim.cli import main

main()
