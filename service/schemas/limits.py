"""Bounds on what requests may hold: all chosen to refuse mistyped values and overflow, not unusual clutches; no tables."""

from datetime import UTC, datetime

#: Duty cycles since new, or in one block.
MAX_CYCLES = 1e12
#: Any other positive number of a request (energy in kJ, speed in rpm, duration in s, pressure in bar, viscosity in cSt).
LARGEST_NUMBER = 1e12

#: When a run may have been started. Other years are a clock's or a program's sign for "not set", as year 1 is.
EARLIEST_START, LATEST_START = datetime(1900, 1, 1, tzinfo=UTC), datetime(9998, 12, 31, tzinfo=UTC)

#: Diameters and radii of the disc, mm.
MIN_LENGTH_MM, MAX_LENGTH_MM = 0.1, 1e5
#: Outer less inner diameter, mm: a narrower ring is mistyped.
MIN_WIDTH_MM = 0.1
#: Friction faces of one clutch.
MAX_FRICTION_FACES = 1000
#: Lining pressure over line pressure.
MIN_PRESSURE_FACTOR, MAX_PRESSURE_FACTOR = 1e-6, 1e6
#: Time constant of the torque channel's own low-pass, ms: a slower one would hide the swing of a dynamic test (0.1 Hz).
MAX_TORQUE_FILTER_MS = 1000
#: Exponent of the severity of a duty cycle.
MAX_SEVERITY_EXPONENT = 10

#: Characters of a material's or fluid's name, a maintenance note, the reason of a change, a diagnosis' name, a file's name
#: and a map of channels.
LONGEST_NAME = 200
LONGEST_NOTE = 4000
LONGEST_REASON = 500
LONGEST_DIAGNOSIS_ID = 64
LONGEST_FILENAME = 255
LONGEST_MAP = 4000
#: A clutch's or a run's name: safe in an address and as a file's name, 128 characters at most.
LONGEST_IDENTIFIER = 128
IDENTIFIER_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}$"
#: Characters of a number in an address. Derived: the longest that a 64-bit float is written in has 24.
LONGEST_NUMBER = 32
#: Quotation marks and opening brackets of a JSON body. Derived: those of a note that consists of them, and as many again.
MAX_MARKS = 10_000
#: Samples of a channel that a plot may ask for: more than any screen has pixels; all samples need no argument.
MAX_POINTS = 1_000_000
#: Held runs that are confirmed in one step. As many as a page lists.
MAX_CONFIRMED = 1000
#: The limits of a criterion: its number of either sign, its place, and how many a clutch may have. Chosen: beyond any rig.
LARGEST_LIMIT, MAX_CRITERION_PRESSURE_BAR, MAX_SPEED_RPM, MAX_CRITERIA = 1e9, 1e4, 1e6, 8
#: The skewness of a surface profile, of either sign. Derived: of n heights it is at most √n, and no profile has 1e8 of them.
LARGEST_SKEWNESS = 1e4
#: Bytes of a photograph, and photographs of one inspection. Chosen: twice what a camera of 24 megapixels writes as JPEG; a
#: place on each of eight radii of both sides of three discs.
MAX_PHOTOGRAPH_BYTES, MAX_PHOTOGRAPHS = 16 << 20, 48
#: Joint draws of a track's coefficients: beyond what the sample behind it holds they would repeat.
MAX_DRAWS = 1_000
#: Blocks of a programme of planned duty.
MAX_BLOCKS = 1000
#: The fewest cycles of a planned block, and its least energy a cycle, kJ: less is mistyped.
MIN_BLOCK_CYCLES, MIN_PLANNED_KJ = 1, 1e-6
#: Characters that a list is searched for, and items that it may pass over.
LONGEST_SEARCH, MAX_OFFSET = 200, 10_000_000
#: Characters of a column's title in a rig profile, columns of one, lines above its table, and words that stand for a kind of
#: run. Derived: what the readers take as a title, and as many columns as they read; chosen: more than any rig has.
LONGEST_TITLE, MAX_COLUMNS, MAX_SKIPPED, MAX_WORDS = 1000, 1000, 10_000, 20
#: Characters of a receiver's address and of the secret that signs what it is sent. Chosen: a query of tokens fits, and what
#: is shorter can be guessed.
LONGEST_ADDRESS, SHORTEST_SECRET, LONGEST_SECRET = 2000, 8, 200
