"""A run's file of any format -> checked columns by public channel name, in the channels' units.

In: a file on disk, its sender's name for it, an optional map of channels. Out: {channel: float64 [n]}, or an error that
names the place. Open `read_file` first; then `detect`, `text`, `sandbox` for all other formats, `column_names` and
`names.toml` for which column is which channel, or the time, and `suggest` for what is proposed where they do not say it.
"""
