"""Compensation tables of controls, read and written; one module a format, `registry` lists them."""
