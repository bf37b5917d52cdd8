"""The numbers that decide which loops are evaluated and what is stated of their lag."""

#: Fewer samples give no loop. Chosen; no table.
FEWEST_SAMPLES = 32
#: A speed whose lowest is below this share of its swing comes near zero. Chosen; no table.
NEAR_ZERO = 0.05
#: Residuals are not white where block means scatter by so many deviations more than white noise's. Chosen; no table.
NOT_WHITE = 2.5

#: The gain's prior deviation [-]. Chosen: what a torque sensor's gain differs by from day to day.
GAIN_SD = 0.05
