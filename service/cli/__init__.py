"""The command `clutchlife`: one file a command, named as the command is.

In: arguments and environment. Out: lines on standard output, errors on standard error, exit codes of sysexits.h. Open `main`
first, then `options` (shared by commands); `answers` shows what the service says, `sending/` is the client of `push`,
`database` works on the file itself, `demo/` is the demonstration.
"""
