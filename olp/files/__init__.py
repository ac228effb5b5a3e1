"""Files that people write and that `olp` writes; below the command line nothing else opens one."""
