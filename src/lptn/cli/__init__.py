"""The command `lptn`: one file a command, thin faces on the library."""
