"""A job as a page for reviewers: nominal, corrected and measured paths, with their errors, in one file."""
