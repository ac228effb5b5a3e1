"""The version of the package, which stamps and reports state."""

__version__ = "0.1.0"
