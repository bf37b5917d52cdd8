"""One SQLite file with many clutches beside one with few: what each request and command costs, in one run."""
