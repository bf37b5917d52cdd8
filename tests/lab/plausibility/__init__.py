"""`make plausibility`: honest campaigns of several rigs are sent run by run, and others with one slip each."""
