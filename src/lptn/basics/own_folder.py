"""Folders that nobody but this user can write to: native code or a pickle that is run from there is the user's own."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def own_folder(folder: Path) -> Path:
    """The folder, made if need be.

    Args:
        folder: where this user alone keeps things.

    Raises:
        OSError: it can't be made, somebody else could put a file into it, or a link in it leads elsewhere.
    """
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    if link := next((entry for entry in folder.iterdir() if entry.is_symlink()), None):
        raise PermissionError(f"{link}: a link, so that what is kept there would be written elsewhere")
    if not hasattr(os, "getuid"):  # Windows keeps a user's folders to the user
        return folder
    status = folder.stat()
    if not _is_own(status) or status.st_mode & 0o022:
        raise PermissionError(f"{folder}: others can write to it, so nothing is loaded from there")
    # Who can rename a folder above, on the way that was written or behind a link, can put another in its place.
    for place in (folder.absolute(), folder.resolve()):
        for above in place.parents:
            if _others_can_rename_in(above):
                raise PermissionError(f"{above}: others can write to it, so nothing is loaded from {folder}")
    return folder


def is_own_file(path: Path) -> bool:
    """Whether it is a file of this user's, and no link to elsewhere."""
    status = path.lstat()
    return stat.S_ISREG(status.st_mode) and _is_own(status)


def _is_own(status: os.stat_result) -> bool:
    return not hasattr(os, "getuid") or status.st_uid == os.getuid()


def _others_can_rename_in(folder: Path) -> bool:
    """Whether somebody but the user and root can rename what stands in a folder."""
    status = folder.stat()
    if status.st_uid not in (0, os.getuid()):
        return True
    if status.st_mode & stat.S_ISVTX:  # as in /tmp, where only who made a thing can rename it
        return False
    # Where each user has a group of their own, folders that this group can write to are usual.
    by_group = status.st_mode & stat.S_IWGRP and status.st_gid != os.getgid()
    return bool(status.st_mode & stat.S_IWOTH or by_group)
