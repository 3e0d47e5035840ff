"""What `layoutrl.bench` measures: simulation, learning, curves, serving; parts: which is which, and their table."""
