"""Numbers that decide how noise is estimated."""

#: Noise [-] as a share of the torque where too little is left to estimate it. Chosen; no table.
ASSUMED = 0.01
#: Free squares (residuals beyond the smooth terms) needed to estimate noise. Chosen; no table.
FEWEST = 12
#: Run-to-run scatter of the gain [-] until it is estimated. Chosen: some tenths of a percent are usual; no table.
USUAL_GAIN = 0.002
#: What is taken for smooth along a curve: polynomials up to this degree; along a loop: so many harmonics. Chosen; no table.
SMOOTH_DEGREE = 4
SMOOTH_HARMONICS = 5
#: Bins that a period must share with the periods before it to be compared with them. Chosen; no table.
LEAST_COMPARED_BINS = 8
#: A row is a spike where it is off its fit and off both its neighbours by more than this many deviations [-] ...
#: Chosen; no table.
SPIKE = 5.5
#: ... while fewer than this share [-] of all rows are. Chosen; no table.
MOST_SPIKES = 0.02
#: Log likelihood [nats] that an autocorrelation must gain over none. Chosen; no table.
CORRELATION_PRICE = 2.0
#: ... over the one that samples show, where they do: they are more than bins are. Chosen; no table.
CORRELATION_PRICE_FROM_SAMPLES = 5.0
#: Log likelihood [nats] that an autocorrelation loses per unit of the log of its variance inflation: slow noise was taken
#: off with everything smooth, so the data say little about it. Chosen; no table.
INFLATION_PRICE = 2.0
#: Kinds of curves or loops (by length and phases), at most, with which an autocorrelation is estimated.
#: Chosen for time; no table.
MOST_KINDS = 40
