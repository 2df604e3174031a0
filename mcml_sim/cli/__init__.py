"""The mcml-sim command, and parts that both programs share."""
