"""How good a layout or an agent is: greedy policies, who furnishes with them, metrics, statistics, the exact model."""
