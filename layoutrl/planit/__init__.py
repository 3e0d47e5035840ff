"""PlanIT's entry point; layoutrl/rivals/planit is what it trains."""
