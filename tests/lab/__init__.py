"""What measures: each module asks, goes on where it ended, stores what it found and writes its table."""
