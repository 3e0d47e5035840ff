"""What `layoutrl.bench` measures: simulation, learning, curves, serving."""
