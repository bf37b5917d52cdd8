"""What one request may cost, and how much is kept for the next."""

#: Bytes of answers that are kept together, those that are given while newer ones are computed among them. Chosen: some
#: hundred pages of `/degradation`.
MAX_CACHED_BYTES = 120 << 20
#: Bytes of JSON from which a run waits among files, lest it hold up short ones. Chosen: plateaus take some 10 kB, a dynamic
#: test 300.
LARGE_BODY_BYTES = 1 << 17
#: Bytes of a JSON run that stay in memory while it waits; a longer one is a file meanwhile. And bytes that the bodies of all
#: requests may have in memory together; those on disk twice what the largest file may have. More are refused with 503.
#: Chosen: plateaus and dynamic tests are shorter; a container of 1 GiB has 300 MiB of processes, and a body is there up to
#: three times while it is passed on.
MAX_BYTES_IN_MEMORY, MAX_BODIES_IN_MEMORY = 1 << 20, 64 << 20
#: Bytes of any other body, and from which on it is checked in a thread. Chosen: four times a plan of 1,000 blocks; checking
#: the worst takes some 20 ms, of 64 KiB 5.
MAX_SHORT_BODY_BYTES, MAX_CHECKED_BYTES = 1 << 18, 1 << 16
#: Bytes of all texts in a form beside its file. Chosen: a rig's profile of 100 columns has 20 kB.
MAX_FORM_TEXT_BYTES = 1 << 17
#: Times its own bytes that a packed body may hold, once it is longer than a piece. Chosen: a recorder's text is packed to a
#: third up to a fortieth, zeros to a thousandth.
MAX_RATIO = 200
#: Bytes that are unpacked, read and sent at once. Chosen: a few writes to the socket.
PIECE_BYTES = 1 << 18
#: Bytes of answers that readers may have in memory together beside one piece each, and seconds within which a reader must
#: take a piece. Chosen: as for bodies; a modem's line takes four.
MAX_ANSWERS_IN_MEMORY, TAKEN_SECONDS = 64 << 20, 30.0
#: Share of the disk's free room that copies may have which are made of runs and their files while these are sent. Chosen:
#: the other half is left to runs that come in.
COPIES_SHARE = 0.5
#: Addresses whose answers are found again before the request is looked at. Chosen: a page asks for some twenty a clutch.
MAX_POLLED = 4096
#: Bytes of an answer from which it is packed, and how hard. Chosen: shorter ones fit in two packets of a network anyway; no
#: table of the level.
MIN_PACKED_BYTES, PACKING_LEVEL = 2048, 4
#: Items a page may hold.
MAX_ITEMS = 1000
#: Items of a page where no limit is given.
USUAL_ITEMS = 100
#: Pressure [bar] and cycles [-] that an argument may name. Derived: a channel's bound; a million times the horizon.
MAX_PRESSURE_BAR = 1e4
MAX_HORIZONS = 1e6
#: Seconds that a POST of a diagnosis waits for its report, and a GET for the newest answer that idle workers compute (whose
#: processors another service may keep busy), where it does not say, and at most. Chosen: the contract's default; what
#: proxies usually let pass.
WAIT_SECONDS, LONGEST_WAIT_SECONDS = 30, 600
#: Bytes a second at which a body must arrive, beyond the seconds that it has in any case. Chosen: a modem's line; 1 GiB may
#: take 4.5 hours.
SLOWEST_BODY_BYTES_PER_SECOND = 1 << 16
#: Bytes that the head of a request may have, its trailers included, and seconds within which it is complete. Chosen: eight
#: times what nginx and Apache take by default; a rig's bad line needs two seconds.
MAX_HEAD_BYTES, HEAD_SECONDS = 1 << 16, 10.0
#: Lines of a head, and arguments of an address. Chosen: what Apache takes by default; a browser sends twenty lines, and no
#: route has thirty arguments. Each is looked at many times on the event loop.
MAX_HEAD_LINES = MAX_ARGUMENTS = 100
#: Requests that one connection may send while an earlier one of its is answered. Chosen: browsers send none ahead.
MAX_AHEAD = 16
#: Seconds for which what a refused connection still sends is thrown away. Chosen: several round trips.
LINGER_SECONDS = 2.0
#: Callers whose shares are kept, and seconds' worth of requests that one may save up. Chosen: more than there are rigs; a
#: page loads some hundred files at once.
MAX_CALLERS, SAVED_SECONDS = 10_000, 2.0
#: Seconds after which a busy service may be asked again.
RETRY_AFTER_SECONDS = 1
#: Seconds between two notes of a key's use. Chosen: each is a commit, and whoever looks for unused keys thinks in days.
USE_NOTED_SECONDS = 3600
#: Seconds after which a disk that does not answer makes the service not ready. Chosen: probes wait for three and more.
LONGEST_LOOK_SECONDS = 2.0
#: Seconds that a look at the store of raw records holds, and that is waited for it: less than for the disk, so that each
#: says what does not answer. Chosen: a request every ten seconds costs nothing.
RAW_LOOK_SECONDS, LONGEST_RAW_LOOK_SECONDS = 10.0, 1.0
#: Clutches that the metrics read at once.
METRICS_PAGE = 1000
#: What may always be asked, without a key and whatever a caller has used of its share.
UNLIMITED = ("/livez", "/readyz")
