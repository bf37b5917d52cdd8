"""The laboratory: what measures, where the rest of `tests` asserts. Each tool asks, goes on where it ended, stores what it
found and writes its table (`measuring`): `blind` (and its rig), `law`, `adoption`, `visible` (diagnosis); `score`,
`plausibility`, `real`, `rivals` (prognosis); `load`, `scale`, `benchmarks`, `files` (service); `figures`, `pictures`;
`mutants`.
"""
