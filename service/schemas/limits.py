"""Bounds on what requests may hold: all chosen to refuse mistyped values and overflow, not unusual clutches; no tables."""

#: Duty cycles since new, or in one block.
MOST_CYCLES = 1e12
#: Any other positive number of a request (energy in kJ, speed in rpm, duration in s, pressure in bar, viscosity in cSt).
LARGEST_NUMBER = 1e12

#: Diameters and radii of the disc, mm.
LEAST_LENGTH_MM, MOST_LENGTH_MM = 0.1, 1e5
#: Outer less inner diameter, mm: a narrower ring is mistyped.
LEAST_WIDTH_MM = 0.1
#: Friction faces of one clutch.
MOST_FRICTION_FACES = 1000
#: Lining pressure over line pressure.
LEAST_PRESSURE_FACTOR, MOST_PRESSURE_FACTOR = 1e-6, 1e6
#: Exponent of the severity of a duty cycle.
MOST_SEVERITY_EXPONENT = 10

#: Characters of a material's or fluid's name, a maintenance note, the reason of a change, a diagnosis' name, a file's name
#: and a map of channels.
LONGEST_NAME = 200
LONGEST_NOTE = 4000
LONGEST_REASON = 500
LONGEST_DIAGNOSIS_ID = 64
LONGEST_FILENAME = 255
LONGEST_MAP = 4000
#: A clutch's or a run's name: safe in an address and as a file's name, 128 characters at most.
IDENTIFIER_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}$"
#: Quotation marks and opening brackets of a JSON body. Derived: those of a note that consists of them, and as many again.
MOST_MARKS = 10_000
#: Samples of a channel that a plot may ask for: more than any screen has pixels; all samples need no argument.
MOST_POINTS = 1_000_000
#: Blocks of a programme of planned duty.
MOST_BLOCKS = 1000
#: The fewest cycles of a planned block, and its least energy a cycle, kJ: less is mistyped.
LEAST_BLOCK_CYCLES, LEAST_PLANNED_KJ = 1, 1e-6
