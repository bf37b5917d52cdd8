"""CSV text of any make -> columns.

In: a byte source. Out: {channel: float64 [n]} and the line of each row. Open `read` first; then `blocks` (encoding), `lines`
(one line), `header_rows` (separator, name row, unit row), `table` (data rows), `cells` and `decimals` (whole blocks, fast).
"""
