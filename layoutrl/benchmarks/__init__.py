"""What `layoutrl.bench` measures: simulation, learning, curves, serving. `parts` has the list and the table."""
