"""Names of the axes on which structure may lie: public channel names, or the test's clock, the cycles, the loop's phase."""

SPEED, PRESSURE, CYCLES = "speed_rpm", "pressure_bar", "cycles"
TEMPERATURE, CLOCK, PHASE = "oil_temperature_c", "test_clock_s", "loop_phase"
TORQUE = "torque_nm"
