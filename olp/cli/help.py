"""`olp help`."""

from __future__ import annotations

import sys

import click

from olp.cli.common import diagnostic, is_terminal, put
from olp.cli.options import force_option
from olp.core.errors import UsageError


@click.command("help")
@click.argument("topic", nargs=-1)
@click.option("--html", "folder", metavar="DIR", help="Write all pages, linked and with a search, into DIR.")
@force_option("pages that exist")
def command(topic: tuple[str, ...], folder: str | None, force: bool) -> None:
    """Show the documentation on a topic, or answer a question.

    TOPIC is the name of a page, a verb, or words of a question: olp help out of square. Without it all pages
    are listed.
    """
    from olp.workflows import help as workflow

    if folder is not None:
        if topic:
            raise UsageError("--html writes all pages; leave the topic out")
        diagnostic(f"wrote {workflow.write_site(folder, force=force)}")
        return
    text = workflow.topic(topic)
    if topic and is_terminal(sys.stdout):
        from rich.console import Console
        from rich.markdown import Markdown

        Console().print(Markdown(text))
    else:
        put(text)
