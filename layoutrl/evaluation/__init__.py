"""How good the result is: rollouts, metrics, yardsticks."""
