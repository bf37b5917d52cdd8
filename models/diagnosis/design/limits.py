"""Limits of a design's size: where a campaign is larger, plateaus, states or samples are taken evenly.

All are chosen for time and memory; no table.
"""

#: Plateaus taken from one stationary run, at most.
MOST_PLATEAUS = 2000
#: Rows of a whole campaign, about; beyond, states are taken evenly.
MOST_ROWS = 40_000
#: States whose loops are used, at most, the first and the last among them: further ones add no evidence in practice.
MOST_LOOP_STATES = 12
#: Change points tried along a life, at most: further ones between them would look the same.
MOST_ONSETS = 20
#: Samples of a stretch at one pressure that are binned, at most.
MOST_SAMPLES = 4000
#: Samples of a stretch from which its speed cycle is fitted, at most (all where the cycle has corners).
CYCLE_SAMPLES = 400
