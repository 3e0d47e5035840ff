"""PlanIT (Wang et al. 2019), the rival of the paper's Table 1: a relation graph, then networks that see the room."""
