"""The texts of laws, a file each; `stage/` holds those of the render."""
