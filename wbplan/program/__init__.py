"""The quadratic program of one tick: its rows, bounds and cost."""
