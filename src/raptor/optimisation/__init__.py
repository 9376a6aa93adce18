"""Search for moulds whose tissues do what is wanted; `command.design` is the door."""
