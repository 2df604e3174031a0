"""The texts of laws, a file each."""
