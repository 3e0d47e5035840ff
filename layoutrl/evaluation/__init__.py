"""How good the result is: policies, metrics, the exact model."""
