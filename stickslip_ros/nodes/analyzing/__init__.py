"""Parts of the analyzer: what it takes in, its bag and its measures."""
