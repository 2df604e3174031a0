"""What the subcommands do. `profilefit.cli` says how they are asked for, and imports these when one is."""
