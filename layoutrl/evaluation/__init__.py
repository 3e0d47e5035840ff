"""Evaluation of agents and layouts: greedy policies, furnishing with them, metrics, statistics, exact optima."""
