"""The SI prefix that suits a value, wherever one is shown: tables, pictures, the dashboard."""

_PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n"}


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a value, rounded, with the prefix that suits it and its unit."""
    scale, prefix = prefix_for(value)
    return f"{value / scale:.{digits}g} {prefix}{unit}"


def prefix_for(largest: float) -> tuple[float, str]:
    """Return what to divide by, and the prefix, so that a value of that magnitude is 1 or more.

    What is smaller than the smallest prefix, zero included, gets none.
    """
    magnitude = abs(largest)
    return next(((scale, p) for scale, p in _PREFIXES.items() if magnitude >= scale), (1.0, ""))
