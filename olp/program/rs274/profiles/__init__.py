"""The controls that read RS-274, one file each."""
