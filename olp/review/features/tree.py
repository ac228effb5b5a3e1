"""The tree of a part: its operations, and in each the features that the program makes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.core.toolpath import Kind
from olp.core.values import dataclass
from olp.review.features.base import Feature
from olp.review.features.comments import comment_between
from olp.review.features.figures import counted
from olp.review.features.ground import Ground
from olp.review.features.registry import BY_NAME, KINDS
from olp.review.scene import Scene

#: Most nodes of a tree.
MOST = 3000
#: Kinds of nodes that are no features.
OPERATION = "operation"
GROUP = "holes"
REST = "more"


@dataclass(slots=True, eq=False)
class Node:
    """A node: its kind, what it is called, its `moves` (rows, rising), and what is below it. `feature` is
    None of operations, groups and the rest. `feeds` are those of the moves that are feed moves."""

    kind: str
    label: str
    detail: str
    moves: Index
    feeds: Index
    feature: Feature | None = None
    children: list[Node] = field(default_factory=list)

    def below(self) -> Iterator[Node]:
        """This node and all below it, depth first."""
        yield self
        for child in self.children:
            yield from child.below()


def tree_of(scene: Scene, most: int = MOST) -> tuple[list[Node], int]:
    """The operations of a scene with their features, and how many nodes are not listed. Where there would be
    more than `most`, those deepest in the tree and last in the program are left out, and the last node
    stands for all of them."""
    ground = Ground(scene)
    operations = _operations(ground)
    for node in _nested(ground) if scene.straight else ():
        operations[int(ground.moves.operation[node.moves[0]])].children.append(node)
    tops = list(operations.values())
    _sort(tops)
    for top in tops:
        top.children = list(_grouped(top.children))
        _commented(ground, top)
    _number(tops)
    return _limited(tops, most)


def _operations(ground: Ground) -> dict[int, Node]:
    """Nodes of the operations that have feed moves, by their numbers in the table."""
    scene, operation = ground.scene, ground.moves.operation
    feed = ground.moves.path.kind != Kind.RAPID
    cuts = np.flatnonzero(np.diff(operation, prepend=-1)) if len(operation) else np.zeros(0, np.int64)
    bounds = np.append(cuts, len(operation))
    nodes: dict[int, Node] = {}
    line, last = ground.moves.path.line, 0
    for a, b in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        feeds = a + np.flatnonzero(feed[a:b])
        if not feeds.size:
            continue
        frame = ground.moves.path.frames[int(ground.moves.path.frame[feeds[0]])]
        tool = int(scene.table.tool[a])
        names = [f"T{tool}" if tool >= 0 else "", frame.work_offset]
        label = ", ".join(name for name in names if name) or "no tool stated"
        comment = comment_between(scene.nominal, last, int(line[feeds[0]]))
        last = int(line[feeds[-1]])
        label = f"{label}: {comment}" if comment else label
        detail = counted(len(feeds), "feed move")
        nodes[int(operation[a])] = Node(OPERATION, label, detail, np.arange(a, b), feeds)
    return nodes


def _nested(ground: Ground) -> list[Node]:
    """The features that only their operation holds, with those that they hold. A container whose moves all
    belong to one other feature is not listed."""
    nodes = [_node(feature) for kind in KINDS for feature in kind.find(ground)]
    parent = _parents(nodes, len(ground.moves.path))
    dropped = {
        k for own, k in zip(nodes, parent, strict=True) if k >= 0 and len(own.moves) == len(nodes[k].moves)
    }
    dropped |= set(_repeated(nodes, len(ground.moves.path)))
    tops: list[Node] = []
    for number, node in enumerate(nodes):
        if number in dropped:
            continue
        holder = parent[number]
        while holder in dropped:
            holder = parent[holder]
        (nodes[holder].children if holder >= 0 else tops).append(node)
    return tops


def _node(feature: Feature) -> Node:
    return Node(feature.kind, feature.label, feature.detail, feature.moves, feature.moves, feature)


def _parents(nodes: list[Node], moves: int) -> list[int]:
    """By node, the smallest container that has all of its moves, or -1; a container is in a larger one."""
    owners = []
    for kind in KINDS:
        if not kind.container:
            continue
        owner = np.full(moves, -1, np.int32)
        for number, node in enumerate(nodes):
            if node.kind == kind.name:
                owner[node.moves] = number
        owners.append(owner)
    parents = []
    for number, node in enumerate(nodes):
        holds = [int(owner[node.moves[0]]) for owner in owners if _one(owner[node.moves])]
        least = len(node.moves) + BY_NAME[node.kind].container
        holds = [k for k in holds if k not in (-1, number) and len(nodes[k].moves) >= least]
        parents.append(min(holds, key=lambda k: len(nodes[k].moves), default=-1))
    return parents


def _repeated(nodes: list[Node], moves: int) -> Iterator[int]:
    """Containers whose moves are some of those of a feature that is none, as the last turn of a helix."""
    owner = np.full(moves, -1, np.int32)
    for number, node in enumerate(nodes):
        if not BY_NAME[node.kind].container:
            owner[node.moves] = number
    for number, node in enumerate(nodes):
        if BY_NAME[node.kind].container and _one(owner[node.moves]) and owner[node.moves[0]] >= 0:
            yield number


def _one(values: npt.NDArray[np.int32]) -> bool:
    return bool((values == values[0]).all())


def _sort(nodes: list[Node]) -> None:
    """Nodes in the order of the program, containers first."""
    nodes.sort(key=lambda node: (int(node.feeds[0]), -len(node.feeds)))
    for node in nodes:
        _sort(node.children)


def _grouped(nodes: list[Node]) -> Iterator[Node]:
    """Nodes in order, those that are alike below one node where the first of them was."""
    groups: dict[str, list[Node]] = {}
    for node in nodes:
        if node.feature is not None and node.feature.alike:
            groups.setdefault(node.feature.alike, []).append(node)
    for node in nodes:
        own = groups.get(node.feature.alike, []) if node.feature is not None else []
        if len(own) < 2:
            yield node
        elif node is own[0]:
            moves = np.sort(np.concatenate([one.moves for one in own]))
            yield Node(GROUP, counted(len(own), node.label), node.detail, moves, moves, None, own)


def _commented(ground: Ground, operation: Node) -> None:
    """Add to details what the program says between features, on lines of its own."""
    if not operation.children:
        return
    line = ground.moves.path.line
    rows = np.unique(np.concatenate([node.feeds for node in operation.children]))
    for node in operation.children:
        place = int(np.searchsorted(rows, node.feeds[0]))
        # the comment before the first feature is that of the operation
        if place > 0:
            before = int(line[rows[place - 1]])
            comment = comment_between(ground.scene.nominal, before, int(line[node.feeds[0]]), alone=True)
            node.detail = f"{node.detail}; {comment}" if comment else node.detail


def _number(tops: list[Node]) -> None:
    """Number the features of each label through the program."""
    counts: dict[str, int] = {}
    for top in tops:
        for node in top.below():
            if node.feature is not None:
                counts[node.label] = counts.get(node.label, 0) + 1
                node.label = f"{node.label} {counts[node.label]}"


def _limited(tops: list[Node], most: int) -> tuple[list[Node], int]:
    """At most so many nodes, and the number of those that are left out."""
    total = sum(1 for top in tops for _ in top.below())
    if total <= most:
        return tops, 0
    left = most - 1
    rest: list[Node] = []
    level: list[list[Node]] = [tops]
    while level:
        following: list[list[Node]] = []
        for siblings in level:
            rest += siblings[left:]
            del siblings[left:]
            left -= len(siblings)
            following += [node.children for node in siblings if node.children]
        level = following
    unlisted = total - (most - 1 - left)
    moves = np.unique(np.concatenate([node.moves for node in rest]))
    feeds = np.unique(np.concatenate([node.feeds for node in rest]))
    label = f"{counted(unlisted, 'more feature')} not listed"
    return [*tops, Node(REST, label, f"the tree lists {most} at most", moves, feeds)], unlisted
