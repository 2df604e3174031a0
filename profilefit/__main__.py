"""`python -m profilefit` is the profilefit command, and so is the script of that name."""

from mcml_sim.cli.lazy import command


def main() -> None:
    """Run the command."""
    command("profilefit.cli")


if __name__ == "__main__":
    main()
