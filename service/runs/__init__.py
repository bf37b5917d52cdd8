"""A run as a file or a JSON body <-> `IncomingRun`, and simulated runs as what is posted.

In: a JSON body (`json_run`), a posted file (`upload`) or a simulated run (`simulated`, `record_writer`). Out: an
`IncomingRun`, or files that `clutchlife push` sends, listed by `manifest`. Open `json_run` first.
"""
