"""Names of the axes on which structure may live: public channel names, or a name of our own where no channel is it."""

SPEED, PRESSURE, TORQUE, TEMPERATURE = "speed_rpm", "pressure_bar", "torque_nm", "oil_temperature_c"
CYCLES, CLOCK, PHASE, FREQUENCY = "cycles", "test_clock_s", "loop_phase", "frequency_hz"
