"""The command `lptn`: one file a command, each a thin wrapper of the library.

Of its lines a third are options with their help, which the site and the completion of the shell read; `check` is the
largest command, since it looks at logs that no other part of the library accepts yet.
"""
