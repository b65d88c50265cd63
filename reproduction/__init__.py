"""Reproduction of the paper: its figures as data, its claims, and the report on them."""
