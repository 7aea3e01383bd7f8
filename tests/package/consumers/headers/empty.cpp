// Nothing: for what only the flags decide.
