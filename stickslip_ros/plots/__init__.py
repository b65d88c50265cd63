"""Figures of the computed results."""
