"""Error against run time: scenes x methods, rendered to growing budgets against converged references."""
