"""The cases of the golden files: commands, programs and expressions, an area a module."""
