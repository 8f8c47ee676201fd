"""What the other rooms stand on: errors, arrays, compiled loops, progress, what people see."""
