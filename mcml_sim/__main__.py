"""`python -m mcml_sim` is the mcml-sim command, and so is the script of that name."""

from mcml_sim.cli.lazy import command


def main() -> None:
    """Run the command."""
    command("mcml_sim.cli.app")


if __name__ == "__main__":
    main()
