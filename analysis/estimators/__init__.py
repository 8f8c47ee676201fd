"""From signals, modes and networks to numbers; each rule on its own, without files."""
