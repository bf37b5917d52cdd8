"""Numbers that decide about the baseline's laws."""

#: b of M̄_c's law over pressure [-] where the data do not determine it: between an exponential and a hyperbola.
#: Chosen; no table.
USUAL_CURVATURE = 0.25
#: b [-] of what is as good as an exponential. Derived: the law differs from e^{-p/p_0} by the share b (p/p_0)²/2.
EXPONENTIAL = 1e-3
#: Bounds of b [-]. The upper one: chosen; no table.
CURVATURE_BOUNDS = (EXPONENTIAL, 5.0)
#: Half of the early drift of log C is done after this share [-] of the life measured. Chosen: as eq. 6 may have it (a drift
#: quadratic in life passed for structure); no table.
EARLY = 0.15
#: Share of the span of pressures below P⁻, and of the way to the law's pole, for which M̄_c's law goes on where the pressure
#: at the clutch is less than was read. Chosen: an offset of -1.3 bar was fitted as -0.44 ± 0.04 bar with the tangent from P⁻
#: on, as -1.1 ± 0.1 bar so.
BELOW = 0.6
