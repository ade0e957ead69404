"""The command `lptn`: one file a command, each a thin wrapper of the library."""
